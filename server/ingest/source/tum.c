/* tum.c -- TUM RGB-D (cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats) and recordings of its form: rgb.txt with
 * "time name" lines, groundtruth.txt with "time tx ty tz qx qy qz qw", camera-to-world with our camera axes.
 * Photographs get the pose at their time; those without two poses at most GAP_SEC apart are left out.
 *
 * The lens is in none of the files. That of TUM's own recordings goes by the camera, freiburg1 to 3, which rgb.txt
 * names in its head; another's is read from calibration.txt: fx fy cx cy and perhaps k1 k2 p1 p2 k3. Pixel centres are
 * at integers. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/pose_track.h"
#include "server/ingest/source/values.h"

#define GAP_SEC 0.1                  /* ground truth comes at 100 Hz; SLAM writes keyframes, at 30 Hz at most */
#define MAX_BYTES ((size_t)64 << 20) /* of a list of poses or photographs: a day of them */

/* fx fy cx cy k1 k2 p1 p2 k3 of the colour cameras, as TUM's page of intrinsics states them. */
static const struct {
    const char *name;
    double v[9];
} cameras[] = {
    {"freiburg1", {517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633}},
    {"freiburg2", {520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172}},
    {"freiburg3", {535.4, 539.2, 320.1, 247.6, 0, 0, 0, 0, 0}},
};

static char *recognise(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, "groundtruth.txt");
    return file && listing_find(l, base, "rgb.txt") ? mem_strdup(file->path) : NULL;
}

static struct lens lens_of(const double v[9]) {
    struct lens lens = lens_pinhole(NAN, NAN, v[0], v[1], v[2] + LENS_PIXEL_CENTRE, v[3] + LENS_PIXEL_CENTRE);
    lens.k[0] = v[4];
    lens.k[1] = v[5];
    lens.p[0] = v[6];
    lens.p[1] = v[7];
    lens.k[2] = v[8];
    return lens;
}

static enum status read_lens(const struct source_place *place, const char *list_text, struct lens *lens,
                             struct error *err) {
    const struct listed_file *file = listing_find(place->listing, place->base, "calibration.txt");
    double v[9] = {0.0};
    char *text;
    if (file) {
        enum status status = listing_text(place->listing, file->path, 4096, &text, err);
        bool is_read = status == STATUS_OK && (numbers_parse(text, 9, v) || numbers_parse(text, 4, v));
        mem_free(text);
        if (status == STATUS_OK && !is_read)
            return error_set(err, STATUS_INPUT, "%s: expected fx fy cx cy, or these and k1 k2 p1 p2 k3", file->path);
        *lens = lens_of(v);
        return status;
    }
    for (size_t i = 0; i < sizeof cameras / sizeof *cameras; i++)
        if (strstr(list_text, cameras[i].name) || strstr(place->base, cameras[i].name)) {
            *lens = lens_of(cameras[i].v);
            return STATUS_OK;
        }
    error_set(err, STATUS_INPUT, "no lens: %srgb.txt names none of TUM's cameras, freiburg1 to freiburg3", place->base);
    return error_hint(err, "put a calibration.txt beside it: fx fy cx cy, or these and k1 k2 p1 p2 k3");
}

static enum status read_track(const struct source_place *place, struct pose_track *track, struct error *err) {
    char *text, *line;
    enum status status = listing_text(place->listing, place->found, MAX_BYTES, &text, err);
    const char *at = text ? text : "";
    for (size_t number = 1; status == STATUS_OK && (line = line_take(&at)) != NULL; number++) {
        double v[8];
        bool is_blank = line[0] == '#' || line[strspn(line, " \t")] == '\0';
        if (!is_blank && !numbers_parse(line + strspn(line, " \t"), 8, v))
            status =
                error_set(err, STATUS_INPUT, "%s, line %zu: expected time tx ty tz qx qy qz qw", place->found, number);
        else if (!is_blank)
            pose_track_add(track, &(struct timed_pose){v[0], {v[7], v[4], v[5], v[6]}, {v[1], v[2], v[3]}});
        mem_free(line);
    }
    pose_track_sort(track);
    mem_free(text);
    return status;
}

static enum status read_photographs(const char *list_text, const struct pose_track *track, const struct lens *lens,
                                    struct frame_list *list, struct error *err) {
    enum status status = STATUS_OK;
    size_t unposed_count = 0;
    char *line;
    while (status == STATUS_OK && (line = line_take(&list_text)) != NULL) {
        char *name;
        double m[3][4], time_sec = strtod(line, &name);
        name += strspn(name, " \t");
        if (line[0] != '#' && name > line && *name && !pose_track_at(track, time_sec, GAP_SEC, m))
            unposed_count++;
        else if (line[0] != '#' && name > line && *name)
            status = frame_list_add(list, m, lens, name, name, NULL, err);
        mem_free(line);
    }
    if (unposed_count > 0)
        findings_warning(list->findings, "%s: %zu photographs have no pose at their time and are not used", list->name,
                         unposed_count);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV, f);
    struct pose_track track = {0};
    struct lens lens;
    struct error own;
    char *list_text = NULL, *name = mem_printf("%srgb.txt", place->base);
    enum status status = listing_text(place->listing, name, MAX_BYTES, &list_text, &own);
    if (status == STATUS_OK)
        status = read_lens(place, list_text, &lens, &own);
    if (status == STATUS_OK)
        status = read_track(place, &track, &own);
    if (status == STATUS_OK)
        status = read_photographs(list_text, &track, &lens, &list, &own);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    pose_track_release(&track);
    mem_free(list_text);
    mem_free(name);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_tum = {"TUM RGB-D", recognise, read};
