/* shade.h -- the kernels of path.c: loops over the lanes of a block, compiled for several instruction sets; the best
 * is chosen at program start. All do the same IEEE operations in the same order, so results do not depend on the
 * choice. */
#ifndef UNBAKE_RENDER_SHADE_H
#define UNBAKE_RENDER_SHADE_H

#include "server/render/guide.h"
#include "server/render/lanes.h"

/* From hit and triangle: point, frame, wo, MIS weight of the emission. */
void shade_surface(struct vertex_block *restrict v, struct shade_block *restrict s);

/* The four texels of each texture lookup, for a texture of this size. */
void shade_place(struct vertex_block *restrict v, struct shade_block *restrict s, uint32_t width, uint32_t height);

/* Cells of the guide. */
void shade_cells(struct shade_block *restrict s, const struct guide_grid *restrict grid);

/* Random numbers of the vertex at `depth` (0: the first hit). */
void shade_numbers(struct shade_block *restrict s, int depth);

/* Picks light triangles from the guide's rows; for lanes that did not choose the environment. */
void shade_pick(struct shade_block *restrict s, const struct guide *restrict guide,
                const struct lights *restrict lights);

/* Normalises the gathered texel values: base colour and filter weights. */
void shade_texture(struct vertex_block *restrict v, struct shade_block *restrict s);

/* Direction, distance and density of the light samples on the chosen triangles. */
void shade_light(struct shade_block *restrict s);

/* Russian roulette at a depth: probability of continuing = clamp(scale * throughput, least, most). */
struct shade_roulette {
    float scale, least, most;
    float least_light; /* minimum probability of tracing a shadow ray */
    float min_color;   /* see struct path_settings */
};

/* Reflection towards the light sample and along the continued path. */
void shade_scatter(struct vertex_block *restrict v, struct shade_block *restrict s, struct shade_roulette roulette);
/* The same where materials have metals. Not for a backward pass. */
void shade_scatter_metals(struct vertex_block *restrict v, struct shade_block *restrict s,
                          struct shade_roulette roulette);

/* Derivatives by all parameters at a vertex, and the radiance that leaves it. */
void shade_backward(const struct vertex_block *restrict v, struct shade_derivative *restrict d);

#endif
