/* materials.c -- see materials.h. */
#include "server/scene/materials.h"

#include "common/mem.h"

void materials_init(struct materials *m, const struct inverse_uv *inverse, size_t segment_count,
                    rgb base_color, float roughness, float specular) {
    texture_init(&m->base_color, inverse, base_color);
    m->segment_count = segment_count;
    m->roughness = mem_array(segment_count, sizeof *m->roughness);
    m->specular = mem_array(segment_count, sizeof *m->specular);
    m->emission = mem_calloc(segment_count, sizeof *m->emission);
    for (size_t s = 0; s < segment_count; s++) {
        m->roughness[s] = roughness;
        m->specular[s] = specular;
    }
}

void materials_release(struct materials *m) {
    texture_release(&m->base_color);
    mem_free(m->roughness);
    mem_free(m->specular);
    mem_free(m->emission);
    *m = (struct materials){0};
}
