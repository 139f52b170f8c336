/* scan_ceiling ROOM KNOWN CAPTURE OUT -- the base colours that no method exceeds which trusts a scan's mesh and poses.
 *
 * CAPTURE is a bundle with the mesh of a scan of ROOM. Its training photographs are replaced by pictures of ROOM's true
 * base colours, rendered from where the photographs were really taken; these are fused onto CAPTURE's mesh with the
 * poses that CAPTURE tells. scan_scores compares the result, which is written to OUT as a job's outputs would be:
 *
 *   scan_scores ROOM OUT "" OUT/truth
 *
 * True base colours are those of ROOM's objects.json; where it names a texture, which the test data lacks, those that a
 * reconstruction on ROOM's own mesh left in KNOWN. So that their error is not taken for the scan's, OUT/truth has the
 * held-out views with the same colours. */
#include <stdio.h>
#include <string.h>

#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/capture/fuse.h"
#include "server/capture/orient.h"
#include "server/evaluate/pair_picture.h"
#include "server/export/mesh_ply.h"
#include "server/ingest/bundle.h"
#include "server/relight/recovered.h"
#include "server/render/film.h"
#include "server/scene/by_segment.h"
#include "server/scene/mesh_denoise.h"
#include "server/scene/normals.h"

#define TEXTURE_SIZE 2048 /* as make fidelity has it */
#define SAMPLES 16        /* of a pixel, as in the truth */
#define SEED 7
#define FILL_TEXELS 64 /* unobserved texels: from so far around, else from their segment */

struct ceiling {
    struct parallel *pool;
    struct scene room, capture;
    struct recovered known; /* of the room's own mesh */
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
    struct views views;
    struct noise noise;
    struct fused fused;
};

/* --- the truth ---------------------------------------------------------------------------------- */

static void set_color(struct ceiling *c, int64_t id, const cJSON *color) {
    const struct mesh *mesh = &c->room.mesh;
    for (size_t i = 0; i < c->known.inverse.valid_count; i++) {
        uint32_t texel = c->known.inverse.valid[i];
        if (mesh->object_id[c->known.inverse.triangle[texel]] != id)
            continue;
        for (int k = 0; k < 3; k++)
            c->known.materials.base_color.texel[texel][k] = (float)cJSON_GetArrayItem(color, k)->valuedouble;
    }
}

static enum status take_true_colors(struct ceiling *c, const char *room, struct error *err) {
    char *path = file_join(room, "truth/objects.json");
    cJSON *list = NULL;
    enum status status = json_read(path, (size_t)1 << 26, &list, err);
    for (const cJSON *o = list ? list->child : NULL; o && status == STATUS_OK; o = o->next) {
        const cJSON *color = cJSON_GetObjectItemCaseSensitive(o, "base_color");
        double id;
        status = json_number(o, "id", path, -1.0, &id, err);
        if (status == STATUS_OK && cJSON_GetArraySize(color) == 3)
            set_color(c, (int64_t)id, color);
    }
    cJSON_Delete(list);
    mem_free(path);
    return status;
}

static enum status load(struct ceiling *c, const char *room, const char *known, const char *capture,
                        struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    enum status status = bundle_load(room, NULL, &limits, c->pool, &c->room, NULL, err);
    if (status == STATUS_OK && !c->room.mesh.object_id)
        status = error_set(err, STATUS_INPUT, "%s: its mesh has no object_id", room);
    if (status == STATUS_OK)
        status = recovered_load(known, &c->room.mesh, c->pool, &c->known, err);
    if (status == STATUS_OK)
        status = take_true_colors(c, room, err);
    if (status == STATUS_OK)
        status = bundle_load(capture, NULL, &limits, c->pool, &c->capture, NULL, err);
    return status;
}

/* The number of a photograph, by which room and capture name it: "images/004.exr", "images/004.jpg". */
static void number_of(const struct photograph *photo, char number[4]) {
    const char *slash = strrchr(photo->name, '/');
    snprintf(number, 4, "%.3s", slash ? slash + 1 : photo->name);
}

static const struct photograph *of_room(const struct ceiling *c, const struct photograph *photo) {
    char wanted[4], number[4];
    number_of(photo, wanted);
    for (size_t i = 0; i < c->room.photograph_count; i++) {
        number_of(&c->room.photograph[i], number);
        if (strcmp(number, wanted) == 0)
            return &c->room.photograph[i];
    }
    return NULL;
}

/* Puts the true base colours into a photograph of the capture, as radiance. */
static enum status show_base_color(struct ceiling *c, struct photograph *photo, struct error *err) {
    const struct photograph *from = of_room(c, photo);
    struct image image = {0};
    size_t pixels = (size_t)photo->camera.width * photo->camera.height;
    if (!from || (size_t)from->camera.width * from->camera.height != pixels)
        return error_set(err, STATUS_INPUT, "%s: the room has no photograph of this number and size", photo->name);
    film_render_first_hits(&c->known.world, &from->camera, SAMPLES, SEED, c->pool, &image);
    struct rgb_columns color = pair_picture_columns(&image, "base_color.");
    for (size_t i = 0; i < pixels; i++)
        for (int k = 0; k < 3; k++)
            photo->pixel[i][k] = image_half_from_float(image.pixel[i * image.channel_count + (size_t)color.at[k]]);
    image_release(&image);
    mem_free(photo->clipped);
    photo->clipped = NULL;
    photo->is_hdr = photo->exposure_known = true;
    photo->exposure = 1.0f;
    photo->gain = rgb_gray(1.0f);
    photo->clip = INFINITY;
    memset(photo->vignette, 0, sizeof photo->vignette);
    return STATUS_OK;
}

/* --- fusing ------------------------------------------------------------------------------------- */

static enum status map_surface(struct ceiling *c, struct error *err) {
    struct mesh *mesh = &c->capture.mesh;
    size_t turned;
    float roughness;
    enum status status = orient_mesh(&c->capture, c->pool, &turned, err);
    if (status != STATUS_OK)
        return status;
    mesh_denoise(mesh, c->pool);
    normals_estimate(mesh, c->pool, &roughness);
    segments_automatic(&c->segments, mesh);
    status = atlas_make(&c->atlas, mesh, &c->segments, TEXTURE_SIZE, 0.0f, ATLAS_PADDING, err);
    if (status != STATUS_OK)
        return status;
    inverse_uv_make(&c->inverse, &c->atlas, mesh->triangle_count, c->pool);
    materials_init(&c->materials, &c->inverse, c->segments.count, rgb_gray(0.5f), 1.0f, 0.0f);
    return world_init(&c->world, mesh, &c->segments, &c->atlas, &c->materials, NULL, c->pool, err);
}

/* The mean of the texels of a segment that were observed. */
static rgb mean_of_segment(const struct ceiling *c, const struct texels_by_segment *texels, size_t segment) {
    double sum[3] = {0.0}, count = 0.0;
    for (uint32_t i = texels->first[segment]; i < texels->first[segment + 1]; i++) {
        rgb value = fused_radiance(&c->fused, texels->texel[i]);
        if (!(c->fused.count[texels->texel[i]] > 0.0f))
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += (double)(&value.r)[k];
        count += 1.0;
    }
    return count > 0.0 ? rgb_make((float)(sum[0] / count), (float)(sum[1] / count), (float)(sum[2] / count))
                       : rgb_gray(0.5f);
}

static void take_fused(struct ceiling *c) {
    struct texels_by_segment texels;
    by_segment_sort(&texels, &c->segments, &c->inverse);
    for (size_t s = 0; s < c->segments.count; s++) {
        rgb mean = mean_of_segment(c, &texels, s);
        for (uint32_t i = texels.first[s]; i < texels.first[s + 1]; i++) {
            uint32_t texel = texels.texel[i];
            rgb value = fused_radiance(&c->fused, texel);
            for (uint32_t around = 2; !(c->fused.count[texel] > 0.0f) && rgb_is_black(value); around *= 2)
                value = around > FILL_TEXELS ? mean : fused_around(&c->fused, &c->atlas, &c->inverse, texel, around);
            memcpy(c->materials.base_color.texel[texel], &value, 3 * sizeof(float));
        }
    }
    by_segment_release(&texels);
}

static enum status fuse_base_colors(struct ceiling *c, struct error *err) {
    enum status status = map_surface(c, err);
    for (size_t i = 0; i < c->capture.photograph_count && status == STATUS_OK; i++)
        if (!c->capture.photograph[i].is_test)
            status = show_base_color(c, &c->capture.photograph[i], err);
    if (status != STATUS_OK)
        return status;
    views_init(&c->views, &c->capture, &c->segments, c->world.accel, c->pool);
    noise_measure(&c->noise, &c->views, c->pool);
    fuse(&c->fused, &c->views, &c->noise, &c->atlas, &c->inverse, c->pool);
    take_fused(c);
    return STATUS_OK;
}

/* --- what is written ---------------------------------------------------------------------------- */

/* The base colours, or one value everywhere, as a texture of R G B. */
static enum status write_texture(const struct ceiling *c, const char *out, const char *name, const float *value,
                                 struct error *err) {
    struct image image;
    char *path = file_join(out, name);
    image_init_rgb(&image, c->atlas.width, c->atlas.height);
    for (size_t i = 0; i < c->inverse.valid_count; i++) {
        size_t texel = c->inverse.valid[i];
        for (int k = 0; k < 3; k++)
            image.pixel[3 * texel + (size_t)k] = value ? *value : c->materials.base_color.texel[texel][k];
    }
    enum status status = image_write_exr(path, &image, IMAGE_FLOAT, false, err);
    image_release(&image);
    mem_free(path);
    return status;
}

/* A held-out view of the truth with the colours that were used. */
static enum status write_truth(struct ceiling *c, const struct photograph *photo, const char *room, const char *out,
                               struct error *err) {
    struct image truth = {0}, known = {0};
    char number[4];
    number_of(photo, number);
    char *from = mem_printf("%s/truth/%s.exr", room, number), *to = mem_printf("%s/truth/%s.exr", out, number);
    enum status status = image_read(from, &truth, NULL, err);
    if (status == STATUS_OK) {
        film_render_first_hits(&c->known.world, &photo->camera, SAMPLES, SEED, c->pool, &known);
        struct rgb_columns a = pair_picture_columns(&truth, "base_color."),
                           b = pair_picture_columns(&known, "base_color.");
        for (size_t i = 0; i < (size_t)truth.width * truth.height; i++)
            for (int k = 0; k < 3; k++)
                truth.pixel[i * truth.channel_count + (size_t)a.at[k]] =
                    known.pixel[i * known.channel_count + (size_t)b.at[k]];
        status = image_write_exr(to, &truth, IMAGE_FLOAT, false, err);
    }
    image_release(&known);
    image_release(&truth);
    mem_free(to);
    mem_free(from);
    return status;
}

static enum status write_all(struct ceiling *c, const char *room, const char *out, struct error *err) {
    static const float rough = 1.0f, none = 0.0f;
    char *truth = file_join(out, "truth"), *ply = file_join(out, "scene.ply");
    enum status status = file_make_dirs(truth, err);
    if (status == STATUS_OK)
        status = mesh_ply_write(ply, &c->capture.mesh, &c->segments, &c->atlas, err);
    if (status == STATUS_OK)
        status = write_texture(c, out, "base_color.exr", NULL, err);
    if (status == STATUS_OK)
        status = write_texture(c, out, "roughness.exr", &rough, err);
    if (status == STATUS_OK)
        status = write_texture(c, out, "specular.exr", &none, err);
    if (status == STATUS_OK)
        status = write_texture(c, out, "emission.exr", &none, err);
    for (size_t i = 0; i < c->room.photograph_count && status == STATUS_OK; i++)
        if (c->room.photograph[i].is_test)
            status = write_truth(c, &c->room.photograph[i], room, out, err);
    mem_free(ply);
    mem_free(truth);
    return status;
}

static enum status run(char **argv, struct error *err) {
    struct ceiling c = {.pool = parallel_new(0)};
    enum status status = load(&c, argv[1], argv[2], argv[3], err);
    if (status == STATUS_OK)
        status = fuse_base_colors(&c, err);
    if (status == STATUS_OK)
        status = write_all(&c, argv[1], argv[4], err);
    fused_release(&c.fused);
    noise_release(&c.noise);
    views_release(&c.views);
    world_release(&c.world);
    materials_release(&c.materials);
    inverse_uv_release(&c.inverse);
    atlas_release(&c.atlas);
    segments_release(&c.segments);
    recovered_release(&c.known);
    scene_release(&c.capture);
    scene_release(&c.room);
    parallel_free(c.pool);
    return status;
}

int main(int argc, char **argv) {
    struct error err = {0};
    if (argc != 5) {
        fprintf(stderr, "usage: scan_ceiling ROOM KNOWN CAPTURE OUT\n");
        return 2;
    }
    if (run(argv, &err) == STATUS_OK)
        return 0;
    fprintf(stderr, "scan_ceiling: %s\n", err.message);
    return 1;
}
