/* niceslam.c -- NICE-SLAM's Replica: traj.txt with a camera-to-world matrix per line, row-major, COLMAP's axes;
 * cam_params.json; photographs results/frame000000.jpg ... Pixel centres are at integers. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/json.h"
#include "common/mem.h"
#include "server/ingest/source/frame_list.h"

#define TRAJECTORY "traj.txt"
#define PARAMETERS "cam_params.json"
#define MAX_PARAMETERS_BYTES ((size_t)1 << 16)

static char *recognise(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, TRAJECTORY);
    return file && listing_find(l, base, PARAMETERS) ? mem_strdup(file->path) : NULL;
}

static enum status parse(const char *text, const char *name, const char *base, const struct lens *lens,
                         struct transforms *t, struct findings *f, struct error *err) {
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
            char *file = mem_printf("%sresults/frame%06zu", base, t->named_count);
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

static enum status read(const struct source_place *place, struct transforms *t, struct findings *f, struct error *err) {
    struct lens lens;
    struct mapping file;
    struct error own;
    char *parameters = mem_printf("%s" PARAMETERS, place->base);
    *t = (struct transforms){.axes = AXES_OPENCV};
    enum status status = read_parameters(place->listing, parameters, &lens, &own);
    mem_free(parameters);
    if (status != STATUS_OK)
        return findings_settle(f, place->found, status, &own, err);
    status = listing_open(place->listing, place->found, "a list of poses", &file, &own);
    if (status == STATUS_OK) {
        char *text = mem_strndup(file.data, file.size);
        status = parse(text, place->found, place->base, &lens, t, f, &own);
        mem_free(text);
    }
    mapping_close(&file);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_niceslam = {"NICE-SLAM's Replica", recognise, read};
