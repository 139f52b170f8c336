/* niceslam.c -- NICE-SLAM's Replica: traj.txt with a camera-to-world matrix per line, row-major, COLMAP's axes;
 * cam_params.json; photographs results/frame000000.jpg ... Pixel centres are at integers. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/json.h"
#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

#define TRAJECTORY "traj.txt"
#define PARAMETERS "cam_params.json"
#define MAX_PARAMETERS_BYTES ((size_t)1 << 16) /* of its file of camera parameters */

/* cam_params.json beside the trajectory or, as in the archive of all rooms, in the folder above; the caller's, NULL:
 * neither. */
static char *find_parameters(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, PARAMETERS);
    char *above = listing_above(base);
    if (!file && above)
        file = listing_find(l, above, PARAMETERS);
    mem_free(above);
    return file ? mem_strdup(file->path) : NULL;
}

static char *recognise(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, TRAJECTORY);
    bool has_frames = listing_has_folder(l, base, "results");
    return file && has_frames ? mem_strdup(file->path) : NULL;
}

static enum status parse(const char *text, const char *name, const struct lens *lens, struct frames *t,
                         struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, name, AXES_OPENCV, f);
    list.may_be_lost = true;
    enum status status = STATUS_OK;
    for (size_t line = 1; *text && status == STATUS_OK; line++) {
        size_t length = strcspn(text, "\n");
        char *own = mem_strndup(text, length), place[48];
        double m[4][4];
        text += length + (text[length] == '\n');
        if (own[strspn(own, " \t\r")] != '\0') {
            snprintf(place, sizeof place, "line %zu", line);
            char *file = mem_printf("results/frame%06zu", t->named_count);
            if (numbers_parse(own + strspn(own, " \t\r"), 16, m[0]))
                status = frame_list_add(&list, m, lens, file, place, NULL, err);
            else
                status = error_set(err, STATUS_INPUT, "%s, line %zu: expected the 16 numbers of a matrix", name, line);
            mem_free(file);
        }
        mem_free(own);
    }
    frame_list_finish(&list);
    return status;
}

/* Reads w h fx fy cx cy from the member "camera". */
static enum status read_parameters(const struct listing *l, const char *name, struct lens *lens, struct error *err) {
    static const char *const key[6] = {"w", "h", "fx", "fy", "cx", "cy"};
    double value[6];
    cJSON *tree = NULL;
    char *text;
    enum status status = listing_text(l, name, MAX_PARAMETERS_BYTES, &text, err);
    if (status == STATUS_OK)
        status = json_parse(text, strlen(text), name, &tree, err);
    const cJSON *camera = cJSON_GetObjectItemCaseSensitive(tree, "camera");
    for (int i = 0; i < 6 && status == STATUS_OK; i++) {
        status = json_number(camera, key[i], name, NAN, &value[i], err);
        if (status == STATUS_OK && isnan(value[i]))
            status = error_set(err, STATUS_INPUT, "%s: \"camera\" has no %s", name, key[i]);
    }
    if (status == STATUS_OK)
        *lens = lens_pinhole(value[0], value[1], value[2], value[3], value[4] + LENS_PIXEL_CENTRE,
                             value[5] + LENS_PIXEL_CENTRE);
    cJSON_Delete(tree);
    mem_free(text);
    return status;
}

/* The data set has one lens for all of its rooms, which a room that was taken alone does not come with. */
static const struct lens replica_lens = {.model = CAMERA_OPENCV,
                                         .width = 1200,
                                         .height = 680,
                                         .fl_x = 600,
                                         .fl_y = 600,
                                         .cx = 599.5 + LENS_PIXEL_CENTRE,
                                         .cy = 339.5 + LENS_PIXEL_CENTRE,
                                         .angle_x = NAN,
                                         .angle_y = NAN};

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct lens lens = replica_lens;
    struct mapping file;
    struct error own;
    enum status status = STATUS_OK;
    char *parameters = find_parameters(place->listing, place->base);
    *t = (struct frames){.axes = AXES_OPENCV};
    if (parameters)
        status = read_parameters(place->listing, parameters, &lens, &own);
    else
        findings_warning(f,
                         "there is no " PARAMETERS ": the lens is taken to be that of NICE-SLAM's Replica, 1200 x 680 "
                         "pixels with a focal length of 600");
    mem_free(parameters);
    if (status != STATUS_OK)
        return findings_settle(f, place->found, status, &own, err);
    status = listing_open(place->listing, place->found, "a list of poses", &file, &own);
    if (status == STATUS_OK) {
        char *text = mem_strndup(file.data, file.size);
        status = parse(text, place->found, &lens, t, f, &own);
        mem_free(text);
    }
    mapping_close(&file);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_niceslam = {"NICE-SLAM's Replica", recognise, read};
