/* denoise.h -- Intel's Open Image Denoise, by the C API of its library, where that is installed (2.x or 1.x): for
 * pictures that people look at, never for what anything is computed from.
 *
 * The library is opened once, before a sandbox closes: it loads further libraries then. */
#ifndef UNBAKE_RELIGHT_DENOISE_H
#define UNBAKE_RELIGHT_DENOISE_H

#include "common/error.h"
#include "common/image.h"

struct denoiser;

/* Where deploy/install-deps.sh puts the library, beside the places where the system's are. */
#define DENOISE_LIBRARY_DIR "/usr/local/lib/unbake"

/* threads: 0: one for each processor. STATUS_UNAVAILABLE: the library is not there, or does not run on this processor.
 * The caller's (denoiser_free). */
enum status denoiser_open(int threads, struct denoiser **denoiser, struct error *err);
void denoiser_free(struct denoiser *denoiser);

/* "Open Image Denoise 2.3.1". Borrowed. */
const char *denoiser_version(const struct denoiser *denoiser);

/* Takes the noise out of channels first, first + 1, first + 2 of `picture`, linear and unbounded, guided by the
 * channels base_color.R G B and normal.X Y Z of `guide` (film_render_first_hits), which is of the same size. */
enum status denoiser_run(const struct denoiser *denoiser, struct image *picture, uint32_t first,
                         const struct image *guide, struct error *err);

#endif
