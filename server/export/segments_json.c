/* segments_json.c -- see segments_json.h. */
#include "server/export/segments_json.h"

#include "common/mem.h"
#include "common/vec.h"
#include "server/export/emission_texture.h"

/* Fills color[segment_count], the mean base colour over observed texels (over all texels if none is observed), and
 * texels[segment_count], the number of a segment's texels. */
static void average_segments(const struct export_input *in, double (*color)[3], size_t *texels) {
    size_t *seen = mem_calloc(in->segments->count, sizeof *seen);
    double(*seen_color)[3] = mem_calloc(in->segments->count, sizeof *seen_color);
    for (size_t i = 0; i < in->inverse->valid_count; i++) {
        uint32_t texel = in->inverse->valid[i], s = in->segments->of_triangle[in->inverse->triangle[texel]];
        bool shown = in->observation_count && in->observation_count[texel] > 0.0f;
        texels[s]++;
        seen[s] += shown;
        for (int c = 0; c < 3; c++) {
            double value = (double)in->materials->base_color.texel[texel][c];
            color[s][c] += value;
            seen_color[s][c] += shown ? value : 0.0;
        }
    }
    for (size_t s = 0; s < in->segments->count; s++)
        for (int c = 0; c < 3 && texels[s] > 0; c++)
            color[s][c] = seen[s] > 0 ? seen_color[s][c] / (double)seen[s] : color[s][c] / (double)texels[s];
    mem_free(seen_color);
    mem_free(seen);
}

cJSON *segments_json(const struct export_input *in) {
    size_t count = in->segments->count;
    double *area = mem_calloc(count, sizeof *area);
    double(*color)[3] = mem_calloc(count, sizeof *color);
    size_t *triangles = mem_calloc(count, sizeof *triangles);
    size_t *texels = mem_calloc(count, sizeof *texels);
    float *scales = emission_texture_scales(in);
    for (size_t t = 0; t < in->mesh->triangle_count; t++) {
        uint32_t s = in->segments->of_triangle[t];
        triangles[s]++;
        area[s] += (double)mesh_triangle_area(in->mesh, t);
    }
    average_segments(in, color, texels);
    cJSON *list = cJSON_CreateArray();
    for (size_t s = 0; s < count; s++) {
        rgb e = in->materials->emission[s];
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "segment", (int64_t)s); /* the same number as in scene.ply */
        json_add_int(entry, "id", in->segments->id[s]);
        const char *name = segments_name(in->segments, in->mesh, s);
        if (name)
            json_add_string(entry, "name", name);
        json_add_int(entry, "triangles", (int64_t)triangles[s]);
        json_add_int(entry, "texels", (int64_t)texels[s]);
        json_add_number(entry, "area_m2", area[s]);
        json_add(entry, "mean_base_color", cJSON_CreateDoubleArray(color[s], 3));
        json_add_number(entry, "roughness", (double)in->materials->roughness[s]);
        json_add_number(entry, "specular", (double)in->materials->specular[s]);
        json_add_bool(entry, "emitter", in->is_emitter[s]);
        json_add(entry, "emission", cJSON_CreateDoubleArray((double[]){(double)e.r, (double)e.g, (double)e.b}, 3));
        json_add_bool(entry, "emission_varies", scales && scales[s] > 0.0f);
        cJSON_AddItemToArray(list, entry);
    }
    mem_free(scales);
    mem_free(texels);
    mem_free(triangles);
    mem_free(color);
    mem_free(area);
    return list;
}
