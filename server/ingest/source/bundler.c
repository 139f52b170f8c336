/* bundler.c -- Bundler v0.3: bundle.out and list.txt (phototour.cs.washington.edu/bundler, section 5).
 *
 * Per camera: f k1 k2; a 3 x 3 rotation, row-major; a translation. World-to-camera, looking along -z with y up; pixel =
 * f (1 + k1 r^2 + k2 r^4) p with p = -P / P.z and the origin at the picture's centre. f = 0: the photograph has no
 * pose. Line i of list.txt begins with the name of camera i's photograph. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

#define MAX_LIST_BYTES ((size_t)16 << 20) /* of the list of photographs */
#define MAX_OUT_BYTES ((size_t)1 << 30)   /* with its points */

static char *recognise(const struct listing *l, const char *base) {
    static const char *const names[] = {"bundle.out", "bundle/bundle.out", "bundle.rd.out"};
    return listing_find_any(l, base, names, 3);
}

/* Takes `count` numbers of the text, which moves on; false at its end or where it holds anything else. */
static bool take(const char **text, size_t count, double *value) {
    for (size_t i = 0; i < count; i++) {
        char *end;
        value[i] = strtod(*text, &end);
        if (end == *text)
            return false;
        *text = end;
    }
    return true;
}

/* list.txt or what else such a list is called; its text, the caller's. */
static enum status read_list(const struct source_place *place, char **text, struct error *err) {
    static const char *const names[] = {"list.txt", "list.orig.txt", "bundle/list.txt", "bundle.out.list.txt",
                                        "list_tmp.txt"};
    char *path = listing_find_any(place->listing, place->base, names, sizeof names / sizeof *names);
    *text = NULL;
    if (path) {
        enum status status = listing_text(place->listing, path, MAX_LIST_BYTES, text, err);
        mem_free(path);
        return status;
    }
    error_set(err, STATUS_INPUT, "%s: there is no list.txt beside it, which names the photographs", place->found);
    return error_hint(err, "list.txt holds the name of a photograph a line, in the order of the cameras");
}

/* Cuts what follows a photograph's name, its flag and focal length ("a b.jpg 0 541.2"): at the first blank behind a
 * picture's extension or, where there is none, the first of all. */
static void cut_name(char *line) {
    for (char *blank = line; (blank += strcspn(blank, " \t"))[0] != '\0'; blank++) {
        char kept = *blank;
        *blank = '\0';
        if (photo_is_picture(line))
            return;
        *blank = kept;
    }
    if (!photo_is_picture(line))
        line[strcspn(line, " \t")] = '\0';
}

/* A camera's 15 numbers; `name` is that of its photograph. */
static enum status add_camera(struct frame_list *list, const double v[15], const char *name, size_t number,
                              struct error *err) {
    double r[3][3], m[3][4];
    char place[32];
    struct lens lens = lens_pinhole(NAN, NAN, v[0], v[0], NAN, NAN);
    lens.k[0] = v[1];
    lens.k[1] = v[2];
    memcpy(r, v + 3, sizeof r);
    pose_invert(r, v + 12, m);
    snprintf(place, sizeof place, "camera %zu", number);
    return frame_list_add(list, m, &lens, name, place, NULL, err);
}

static enum status read_cameras(const char *text, const char *names, struct frame_list *list, struct error *err) {
    double counts[2], v[15];
    size_t unposed_count = 0;
    enum status status = STATUS_OK;
    while (*text == '#')
        text += strcspn(text, "\n"), text += *text == '\n';
    if (!take(&text, 2, counts) || !(counts[0] >= 0.0 && counts[0] <= FRAMES_MAX))
        return error_set(err, STATUS_INPUT, "%s: expected the numbers of cameras and of points", list->name);
    for (size_t i = 0; i < (size_t)counts[0] && status == STATUS_OK; i++) {
        char *line = line_take(&names);
        if (!line)
            return error_set(err, STATUS_INPUT, "%s has %.0f cameras, but the list names only %zu photographs",
                             list->name, counts[0], i);
        cut_name(line);
        if (!take(&text, 15, v))
            status = error_set(err, STATUS_INPUT, "%s: camera %zu has not its 15 numbers", list->name, i);
        else if (v[0] == 0.0)
            unposed_count++;
        else
            status = add_camera(list, v, line, i, err);
        mem_free(line);
    }
    frame_list_warn_unposed(list, unposed_count);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENGL_INVERSE, f);
    struct error own;
    char *names = NULL, *text;
    enum status status = listing_text(place->listing, place->found, MAX_OUT_BYTES, &text, &own);
    if (status == STATUS_OK)
        status = read_list(place, &names, &own);
    if (status == STATUS_OK)
        status = read_cameras(text, names, &list, &own);
    mem_free(text);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    mem_free(names);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_bundler = {"Bundler", recognise, read};
