/* shade.h -- the arithmetic of path.c: loops over the lanes of a block, compiled for several
 * instruction sets of which the best is chosen when the program starts. All of them do the same
 * IEEE operations in the same order: results do not depend on the choice. */
#ifndef UNBAKE_RENDER_SHADE_H
#define UNBAKE_RENDER_SHADE_H

#include "server/render/guide.h"
#include "server/render/lanes.h"

/* From the hit and the triangle: point, frame, wo, weight of the emission. */
void shade_surface(struct vertex_block *restrict v, struct shade_block *restrict s);

/* The four texels around the places in a texture of this size. */
void shade_place(struct vertex_block *restrict v, struct shade_block *restrict s, uint32_t width,
                 uint32_t height);

/* The guide's cells. */
void shade_cells(struct shade_block *restrict s, const struct guide_grid *restrict grid);

/* Random numbers of the vertex that ends segment number `depth` (0: the camera's). */
void shade_numbers(struct shade_block *restrict s, int depth);

/* The light triangles that the rows of a guide pick, for lanes whose choice is not the environment. */
void shade_pick(struct shade_block *restrict s, const struct guide *restrict guide,
                const struct lights *restrict lights);

/* From the texel values gathered: base colour and weights. */
void shade_texture(struct vertex_block *restrict v, struct shade_block *restrict s);

/* From the chosen triangles: direction, distance and density of the light samples. */
void shade_light(struct shade_block *restrict s);

/* How roulette is played at a depth: chance = clamp(scale * worth, least, most). */
struct shade_roulette {
    float scale, least, most;
    float least_light; /* chance of a light sample to be traced */
    float least_color; /* see struct path_settings */
};

/* Reflection towards the light samples and on along the path. */
void shade_scatter(struct vertex_block *restrict v, struct shade_block *restrict s,
                   struct shade_roulette roulette);

/* Derivatives of everything at a vertex, and the radiance that leaves it. */
void shade_backward(const struct vertex_block *restrict v, struct shade_derivative *restrict d);

#endif
