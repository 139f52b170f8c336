/* nerfstudio.c -- transforms.json of nerfstudio and instant-ngp; transforms.h says what is read of it. */
#include <string.h>

#include "common/buf.h"
#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/source.h"

static char *recognise(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_find(l, base, "transforms.json");
    return file ? mem_strdup(file->path) : NULL;
}

/* Makes the paths relative to the root: the file's are relative to its folder. */
static void rebase(const char *found, struct transforms *t) {
    int length = (int)(path_base(found) - found);
    if (length == 0)
        return;
    char **path[2] = {&t->mesh, &t->point_cloud};
    for (size_t i = 0; i < 2 + 2 * t->frame_count; i++) {
        struct transforms_frame *frame = i < 2 ? NULL : &t->frame[i / 2 - 1];
        char **at = i < 2 ? path[i] : i % 2 ? &frame->mask : &frame->file, *old = *at;
        *at = old ? mem_printf("%.*s%s", length, found, old) : NULL;
        mem_free(old);
    }
}

static enum status read(const struct source_place *place, struct transforms *t, struct findings *f, struct error *err) {
    struct mapping file;
    struct error own;
    cJSON *tree = NULL;
    const char *name = place->found;
    *t = (struct transforms){.axes = AXES_OPENGL};
    enum status status = listing_open(place->listing, name, "a list of frames", &file, &own);
    if (status == STATUS_OK && file.size > TRANSFORMS_MAX_BYTES)
        status = error_set(&own, STATUS_LIMIT, "%s is larger than %zu bytes", name, (size_t)TRANSFORMS_MAX_BYTES);
    if (status == STATUS_OK)
        status = json_parse(file.data, file.size, name, &tree, &own);
    mapping_close(&file);
    if (status != STATUS_OK)
        return findings_settle(f, name, status, &own, err);
    transforms_read(tree, name, t, f);
    rebase(name, t);
    cJSON_Delete(tree);
    return STATUS_OK;
}

const struct source source_nerfstudio = {"nerfstudio transforms.json", recognise, read};
