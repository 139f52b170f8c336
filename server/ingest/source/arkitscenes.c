/* arkitscenes.c -- ARKitScenes' raw and 3DOD data (github.com/apple/ARKitScenes, DATA.md): lowres_wide.traj with lines
 * of time, axis times angle, translation, world-to-camera with our camera axes; photographs lowres_wide/ID_TIME.png and
 * a lens each, lowres_wide_intrinsics/ID_TIME.pincam: w h fx fy cx cy. The mesh ID_3dod_mesh.ply is in the same world.
 * Photographs get the pose at their time, between those of the trajectory, which come at 10 Hz. wide/ (1920 x 1440) and
 * vga_wide/ (640 x 480) of the raw data are of the same camera and are preferred where they are there. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/pose_track.h"
#include "server/ingest/source/values.h"

#define GAP_SEC 0.25                 /* of two poses; a lost one is passed over */
#define MAX_BYTES ((size_t)64 << 20) /* of the file of poses: a day of them */

/* The sharpest photographs that are there; NULL: none are. */
static const char *folder_of(const struct listing *l, const char *base) {
    static const char *const folders[] = {"wide", "vga_wide", "lowres_wide"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++)
        if (listing_has_folder(l, base, folders[i]))
            return folders[i];
    return NULL;
}

static char *recognise(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, "lowres_wide.traj");
    return file && folder_of(l, base) ? mem_strdup(file->path) : NULL;
}

static enum status read_track(const struct source_place *place, struct pose_track *track, struct error *err) {
    char *text, *line;
    enum status status = listing_text(place->listing, place->found, MAX_BYTES, &text, err);
    const char *at = text ? text : "";
    for (size_t number = 1; status == STATUS_OK && (line = line_take(&at)) != NULL; number++) {
        double v[7], r[3][3], m[3][4];
        bool is_blank = line[strspn(line, " \t")] == '\0';
        if (!is_blank && !numbers_parse(line, 7, v)) {
            status = error_set(err, STATUS_INPUT, "%s, line %zu: expected a time and 6 numbers", place->found, number);
        } else if (!is_blank) {
            double angle = sqrt(v[1] * v[1] + v[2] * v[2] + v[3] * v[3]),
                   s = angle > 0.0 ? sin(0.5 * angle) / angle : 0.0;
            rotation_from_axis_angle(v + 1, r);
            pose_invert(r, v + 4, m);
            pose_track_add(track, &(struct timed_pose){v[0],
                                                       {cos(0.5 * angle), -s * v[1], -s * v[2], -s * v[3]},
                                                       {m[0][3], m[1][3], m[2][3]}});
        }
        mem_free(line);
    }
    pose_track_sort(track);
    mem_free(text);
    return status;
}

/* The lens file that is nearest in time; NULL: there is none. */
static const struct listed_file *nearest_lens(const struct source_place *place, const char *folder, double time_sec) {
    const struct listed_file *file, *best = NULL;
    double least = INFINITY;
    char *pattern = mem_printf("%s_intrinsics/*.pincam", folder);
    for (size_t at = 0; (file = listing_match(place->listing, place->base, pattern, &at)) != NULL;) {
        const char *time = strrchr(file->path, '_');
        double off = time ? fabs(strtod(time + 1, NULL) - time_sec) : INFINITY;
        if (!best || off < least) {
            least = off;
            best = file;
        }
    }
    mem_free(pattern);
    return best;
}

/* The lens of the photograph whose name without extension is `stem`: its times are rounded differently now and then, so
 * that it may be found by the time only. */
static enum status read_lens(const struct source_place *place, const char *folder, const char *stem, struct lens *lens,
                             struct error *err) {
    double v[6];
    char *own = mem_printf("%s_intrinsics/%s.pincam", folder, stem);
    const struct listed_file *file = listing_find(place->listing, place->base, own);
    mem_free(own);
    const char *time = strrchr(stem, '_');
    if (!file)
        file = nearest_lens(place, folder, time ? strtod(time + 1, NULL) : 0.0);
    if (!file)
        return error_set(err, STATUS_INPUT, "no lens: there is no %s_intrinsics/*.pincam", folder);
    enum status status = numbers_read(place->listing, file->path, 6, "a lens (w h fx fy cx cy)", v, err);
    if (status == STATUS_OK)
        *lens = lens_pinhole(v[0], v[1], v[2], v[3], v[4], v[5]);
    return status;
}

static enum status read_photograph(const struct source_place *place, const char *folder, const char *path,
                                   const struct pose_track *track, struct frame_list *list, size_t *unposed_count,
                                   struct error *err) {
    const char *name = path_base(path), *time = strrchr(name, '_');
    char *stem = mem_strndup(name, (size_t)(path_extension(name) - name) - 1);
    double m[3][4];
    struct lens lens;
    enum status status = STATUS_OK;
    if (!time || !pose_track_at(track, strtod(time + 1, NULL), GAP_SEC, m)) {
        (*unposed_count)++;
    } else {
        char *file = mem_printf("%s/%s", folder, name);
        status = read_lens(place, folder, stem, &lens, err);
        if (status == STATUS_OK)
            status = frame_list_add(list, m, &lens, file, file, NULL, err);
        mem_free(file);
    }
    mem_free(stem);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV_INVERSE, f);
    struct pose_track track = {0};
    struct error own;
    const struct listed_file *file;
    size_t unposed_count = 0;
    const char *folder = folder_of(place->listing, place->base);
    char *pattern = mem_printf("%s/*.png", folder ? folder : "");
    enum status status = read_track(place, &track, &own);
    for (size_t at = 0;
         status == STATUS_OK && (file = listing_match(place->listing, place->base, pattern, &at)) != NULL;)
        status = read_photograph(place, folder, file->path, &track, &list, &unposed_count, &own);
    if (unposed_count > 0)
        findings_warning(f, "%s: %zu photographs have no pose at their time and are not used", place->found,
                         unposed_count);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    pose_track_release(&track);
    mem_free(pattern);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_arkitscenes = {"ARKitScenes", recognise, read};
