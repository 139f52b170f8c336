/* passes.h -- what is rendered of a view, and the pictures that show it. */
#ifndef UNBAKE_RELIGHT_PASSES_H
#define UNBAKE_RELIGHT_PASSES_H

#include <stdbool.h>
#include <stddef.h>

#include "common/image.h"
#include "common/json.h"

enum pass_kind {
    PASS_LIGHT,  /* radiance: PNG by exposure and view transform */
    PASS_COLOR,  /* linear reflectance in [0, 1] */
    PASS_SHARE,  /* a number in [0, 1], shown as a grey code value */
    PASS_NORMAL, /* a unit vector n; PNG shows (n + 1) / 2 as code values */
    PASS_DATA    /* EXR only */
};

struct render_pass {
    const char *name; /* as the setting `passes` has it */
    enum pass_kind kind;
    bool is_light;        /* from the render; else from film_render_first_hits */
    const char *from;     /* its first channel there; "-": the difference of R and direct.R */
    uint32_t count;       /* channels */
    const char *label[3]; /* their names in EXR */
};

const struct render_pass *passes_table(size_t *count);
/* The pass `radiance`, which lights alone are files of, too. */
const struct render_pass *passes_radiance(void);

struct view_look {
    float exposure;
    bool is_filmic;
    float nits_per_unit; /* of light in EXR; 1: radiance */
};

/* The pass as a picture of its own. `light` and `first` are a render and its first hits; either may be NULL where the
 * pass needs the other. *image is the caller's. */
void pass_take(const struct render_pass *pass, const struct image *light, const struct image *first,
               struct image *image);

/* All passes for which is_wanted[] holds (in the order of the table) as layers of one picture: radiance's channels are
 * R G B, the others' have the pass before them (depth.Z). Light is in the unit of `look`. *image is the caller's. */
void passes_layered(const bool *is_wanted, const struct view_look *look, const struct image *light,
                    const struct image *first, struct image *image);

/* Changes it into what image_write_png shows with scale 1. */
void pass_show(const struct render_pass *pass, const struct view_look *look, struct image *image);
/* Changes light into the unit that EXR has. */
void pass_measure(const struct render_pass *pass, const struct view_look *look, struct image *image);

#endif
