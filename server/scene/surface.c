/* surface.c -- see surface.h. */
#include "server/scene/surface.h"

vec3 surface_shading(const struct mesh *mesh, uint32_t triangle, float b1, float b2, vec3 normal) {
    if (!mesh->normal)
        return normal;
    const uint32_t *v = mesh->index[triangle];
    vec3 n = vec3_scale(mesh->normal[v[0]], 1.0f - b1 - b2);
    n = vec3_mad(n, b1, mesh->normal[v[1]]);
    n = vec3_normalize(vec3_mad(n, b2, mesh->normal[v[2]]));
    return vec3_dot(n, normal) > 0.0f ? n : normal;
}

bool surface_at(const struct mesh *mesh, const struct atlas *atlas, const struct inverse_uv *inverse, float x, float y,
                struct surface_point *p) {
    if (!inverse_uv_lookup(inverse, atlas, x, y, &p->triangle, &p->b1, &p->b2))
        return false;
    p->position = mesh_point(mesh, p->triangle, p->b1, p->b2);
    p->normal = vec3_normalize(mesh_cross(mesh, p->triangle));
    p->shading = surface_shading(mesh, p->triangle, p->b1, p->b2, p->normal);
    return true;
}

bool surface_at_texel(const struct mesh *mesh, const struct atlas *atlas, const struct inverse_uv *inverse,
                      uint32_t texel, struct surface_point *p) {
    return surface_at(mesh, atlas, inverse, (float)(texel % inverse->width) + 0.5f,
                      (float)(texel / inverse->width) + 0.5f, p);
}

float surface_texel_m2(const struct mesh *mesh, const struct atlas *atlas, uint32_t triangle) {
    const vec2 *c = atlas->corner[triangle];
    float texels = fabsf((c[1].x - c[0].x) * (c[2].y - c[0].y) - (c[1].y - c[0].y) * (c[2].x - c[0].x));
    return texels > 0.0f ? vec3_length(mesh_cross(mesh, triangle)) / texels : 0.0f;
}
