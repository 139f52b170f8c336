/* transforms_file.c -- transforms.json of nerfstudio and instant-ngp (transforms.h says what is read of it), and the
 * same in three files, as NeRF's synthetic scenes and BlenderNeRF have it: transforms_train.json, _val.json and
 * _test.json, the latter two held out. */
#include "server/ingest/source/transforms_file.h"

#include <string.h>

#include "common/mem.h"
#include "common/utf8.h"
#include "server/ingest/path.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/transforms.h"

/* UTF-8, or UTF-16 as PowerShell's > writes it. */
static enum status parse(const struct mapping *file, const char *path, cJSON **tree, struct error *err) {
    size_t length;
    char *text = utf8_from_utf16(file->data, file->size, &length);
    enum status status = text ? json_parse(text, length, path, tree, err)
                              : json_parse((const char *)file->data, file->size, path, tree, err);
    mem_free(text);
    return status;
}

enum status transforms_file_read(const struct source_place *place, const char *path, struct frames *t,
                                 struct findings *f, struct error *err) {
    struct mapping file;
    struct error own;
    cJSON *tree = NULL;
    *t = (struct frames){.axes = AXES_OPENGL};
    enum status status = listing_open(place->listing, path, "a list of frames", &file, &own);
    if (status == STATUS_OK && file.size > TRANSFORMS_MAX_BYTES)
        status = error_set(&own, STATUS_LIMIT, "%s is larger than %zu bytes", path, (size_t)TRANSFORMS_MAX_BYTES);
    if (status == STATUS_OK)
        status = parse(&file, path, &tree, &own);
    mapping_close(&file);
    if (status != STATUS_OK)
        return findings_settle(f, path, status, &own, err);
    transforms_read(tree, path, t, f);
    cJSON_Delete(tree);
    return STATUS_OK;
}

/* Puts the folder (a base) before the paths of meshes; photo_folder.h does it for photographs and masks. */
static void rebase(const char *folder, struct frames *t) {
    char **path[2] = {&t->mesh, &t->point_cloud};
    for (int i = 0; i < 2; i++) {
        char *old = *path[i];
        *path[i] = old ? mem_printf("%s%s", folder, old) : NULL;
        mem_free(old);
    }
}

/* --- one file --------------------------------------------------------------------------------- */

static char *recognise(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, "transforms.json");
    return file ? mem_strdup(file->path) : NULL;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    char *folder = mem_strndup(place->found, (size_t)(path_base(place->found) - place->found));
    enum status status = transforms_file_read(place, place->found, t, f, err);
    rebase(folder, t);
    photo_folder_resolve(place->listing, folder, false, t, f);
    photo_folder_settle_masks(place->listing, folder, t, f);
    mem_free(folder);
    return status;
}

const struct source source_nerfstudio = {"nerfstudio transforms.json", recognise, read};

/* --- three files ------------------------------------------------------------------------------ */

static char *recognise_split(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, "transforms_train.json");
    return file ? mem_strdup(file->path) : NULL;
}

/* Moves the frames of `from` behind those of t; frees the rest. */
static void append(struct frames *t, struct frames *from) {
    t->frame = mem_realloc_array(t->frame, t->frame_count + from->frame_count + 1, sizeof *t->frame);
    for (size_t i = 0; i < from->frame_count; i++) {
        from->frame[i].is_test = true;
        from->frame[i].number += t->named_count;
        t->frame[t->frame_count + i] = from->frame[i];
    }
    t->frame_count += from->frame_count;
    t->named_count += from->named_count;
    from->frame_count = 0;
    frames_release(from);
}

/* Frames without a photograph: BlenderNeRF writes test views without rendering them. */
static void drop_absent(const struct listing *l, const char *name, struct frames *t, struct findings *f) {
    size_t kept = 0;
    for (size_t i = 0; i < t->frame_count; i++) {
        if (listing_find(l, "", t->frame[i].file))
            t->frame[kept++] = t->frame[i];
        else
            frame_release(&t->frame[i]);
    }
    if (kept < t->frame_count)
        findings_warning(f, "%s: %zu of its %zu frames have no photograph and were left out", name,
                         t->frame_count - kept, t->frame_count);
    t->frame_count = kept;
}

static enum status read_split(const struct source_place *place, struct frames *t, struct findings *f,
                              struct error *err) {
    static const char *const names[] = {"transforms_val.json", "transforms_test.json"};
    enum status status = transforms_file_read(place, place->found, t, f, err);
    rebase(place->base, t);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    photo_folder_settle_masks(place->listing, place->base, t, f);
    for (int i = 0; i < 2 && status == STATUS_OK; i++) {
        struct frames held_out;
        const struct listed_file *file = listing_find(place->listing, place->base, names[i]);
        if (!file)
            continue;
        status = transforms_file_read(place, file->path, &held_out, f, err);
        photo_folder_resolve(place->listing, place->base, false, &held_out, f);
        photo_folder_settle_masks(place->listing, place->base, &held_out, f);
        rebase(place->base, &held_out);
        drop_absent(place->listing, file->path, &held_out, f);
        append(t, &held_out);
    }
    return status;
}

const struct source source_nerf_synthetic = {"transforms_train.json of NeRF's synthetic scenes", recognise_split,
                                             read_split};
