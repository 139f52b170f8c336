/* virtual_objects.c -- see virtual_objects.h.
 *
 * A ball is an icosahedron whose triangles are split into four, three times. It is as large as makes its surface that
 * of the ball: the mean area that a convex body shows is a quarter of its surface (Cauchy), so it gives as much
 * light. */
#include "server/relight/virtual_objects.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/relight/mesh_object.h"
#include "server/relight/virtual_object_settings.h"

#define BALL_SPLITS 3       /* of an icosahedron's triangles into four: 1,280 triangles */
#define DISC_CORNERS 32     /* of the polygon of a disc's area that stands for it */
#define LAMP_ROUGHNESS 0.5f /* of a black body without a highlight: no matter */

void virtual_objects_release(struct virtual_objects *t) {
    for (size_t i = 0; i < t->count; i++) {
        mem_free(t->object[i].name);
        mem_free(t->object[i].part);
        mesh_release(&t->object[i].mesh);
        if (t->object[i].baked)
            bake_release(t->object[i].baked);
        mem_free(t->object[i].baked);
    }
    for (size_t i = 0; i < t->note_count; i++)
        mem_free(t->note[i]);
    mem_free(t->note);
    mem_free(t->object);
    *t = (struct virtual_objects){0};
}

/* --- shapes ----------------------------------------------------------------------------------------------------- */

static void begin(struct mesh *m, size_t vertices, size_t triangles) {
    *m = (struct mesh){.position = mem_array(vertices, sizeof *m->position),
                       .index = mem_array(triangles, sizeof *m->index)};
}

static void add_triangle(struct mesh *m, vec3 a, vec3 b, vec3 c) {
    uint32_t first = (uint32_t)m->vertex_count;
    const uint32_t corner[3] = {first, first + 1, first + 2};
    m->position[m->vertex_count++] = a;
    m->position[m->vertex_count++] = b;
    m->position[m->vertex_count++] = c;
    memcpy(m->index[m->triangle_count++], corner, sizeof corner);
}

/* Two unit vectors that make a right-handed frame with `front`, the first of them level. */
static void frame_of(vec3 front, vec3 up, vec3 *across, vec3 *along) {
    *across = vec3_cross(up, front);
    if (vec3_length(*across) < 1e-3f)
        vec3_frame(front, across, along);
    *across = vec3_normalize(*across);
    *along = vec3_cross(front, *across);
}

static void make_area(vec3 centre, vec3 front, vec3 up, double width, double height, struct mesh *m) {
    vec3 across, along, corner[4];
    frame_of(front, up, &across, &along);
    for (int k = 0; k < 4; k++) {
        float x = k == 1 || k == 2 ? 0.5f : -0.5f, y = k >= 2 ? 0.5f : -0.5f;
        corner[k] = vec3_mad(vec3_mad(centre, x * (float)width, across), y * (float)height, along);
    }
    begin(m, 6, 2);
    add_triangle(m, corner[0], corner[1], corner[2]);
    add_triangle(m, corner[0], corner[2], corner[3]);
}

/* A regular polygon of the disc's area. */
static void make_disc(vec3 centre, vec3 front, vec3 up, double radius, struct mesh *m) {
    double step = 2.0 * PI / DISC_CORNERS, reach = radius * sqrt(step / sin(step));
    vec3 across, along;
    frame_of(front, up, &across, &along);
    begin(m, (size_t)3 * DISC_CORNERS, DISC_CORNERS);
    for (int k = 0; k < DISC_CORNERS; k++) {
        vec3 corner[2];
        for (int i = 0; i < 2; i++)
            corner[i] = vec3_mad(vec3_mad(centre, (float)(reach * cos(step * (k + i))), across),
                                 (float)(reach * sin(step * (k + i))), along);
        add_triangle(m, centre, corner[0], corner[1]);
    }
}

static void split_ball(struct mesh *m, vec3 a, vec3 b, vec3 c, int splits) {
    if (splits == 0) {
        add_triangle(m, a, b, c);
        return;
    }
    vec3 ab = vec3_normalize(vec3_add(a, b)), bc = vec3_normalize(vec3_add(b, c)), ca = vec3_normalize(vec3_add(c, a));
    split_ball(m, a, ab, ca, splits - 1);
    split_ball(m, ab, b, bc, splits - 1);
    split_ball(m, ca, bc, c, splits - 1);
    split_ball(m, ab, bc, ca, splits - 1);
}

static void make_ball(vec3 centre, double radius, struct mesh *m) {
    static const uint8_t face[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                        {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                        {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                        {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    const float g = 1.618034f;
    const vec3 corner[12] = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                             {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    size_t triangles = (size_t)20 << (2 * BALL_SPLITS);
    begin(m, 3 * triangles, triangles);
    for (int f = 0; f < 20; f++)
        split_ball(m, vec3_normalize(corner[face[f][0]]), vec3_normalize(corner[face[f][1]]),
                   vec3_normalize(corner[face[f][2]]), BALL_SPLITS);
    float scale = (float)(radius * sqrt(4.0 * PI / mesh_area(m)));
    for (size_t v = 0; v < m->vertex_count; v++)
        m->position[v] = vec3_mad(centre, scale, m->position[v]);
}

/* --- lamps ------------------------------------------------------------------------------------------------------ */

/* Of ((c - outer) / (inner - outer))^2 over the cone, and 1 within the inner one, times 2 pi. */
double virtual_objects_spot_flux(struct emission_cone cone) {
    double inner = (double)cone.inner, outer = (double)cone.outer;
    return 2.0 * PI * (1.0 - inner + (inner - outer) / 3.0);
}

static struct emission_cone cone_of(const cJSON *s, uint32_t n) {
    double half = 0.5 * virtual_object_number(s, "lamp", n, "angle") * PI / 180.0,
           blend = virtual_object_number(s, "lamp", n, "blend");
    double outer = cos(half), inner = cos(half * (1.0 - blend));
    return (struct emission_cone){(float)outer, (float)fmax(inner, outer + 1e-4)};
}

/* The radiance that gives the flux, of the colour of `radiance`. */
static rgb radiance_of_flux(const cJSON *s, double lumen, double flux_per_luminance, rgb radiance) {
    double luminance = lumen / flux_per_luminance / render_settings_number(s, "luminance_per_unit");
    float now = rgb_luminance(radiance);
    return now > 0.0f ? rgb_scale(radiance, (float)luminance / now) : radiance;
}

static enum status make_lamp(const cJSON *s, uint32_t n, const struct compass *compass, const double offset[3],
                             struct virtual_object *lamp, struct error *err) {
    struct virtual_object_key_text kind = virtual_object_key("lamp", n, "kind");
    rgb toward = virtual_object_color(s, "lamp", n, "direction");
    vec3 centre = virtual_object_position(s, "lamp", n, offset),
         front = vec3_normalize(vec3_make(toward.r, toward.g, toward.b));
    double size[RENDER_MAX_NUMBERS], radius = virtual_object_number(s, "lamp", n, "radius"), solid = PI;
    lamp->cone.outer = -1.0f;
    if (!render_settings_is(s, kind.text, "sphere") && !(vec3_length(front) > 0.0f))
        return error_set(err, STATUS_INPUT, "setting lamp.%u.direction: must not be 0, 0, 0", n);
    if (render_settings_is(s, kind.text, "sphere")) {
        make_ball(centre, radius, &lamp->mesh);
    } else if (render_settings_is(s, kind.text, "spot")) {
        make_disc(centre, front, compass->up, radius, &lamp->mesh);
        lamp->cone = cone_of(s, n);
        solid = virtual_objects_spot_flux(lamp->cone);
    } else {
        render_settings_numbers(s, virtual_object_key("lamp", n, "size").text, size);
        make_area(centre, front, compass->up, size[0], size[1], &lamp->mesh);
    }
    lamp->name = mem_printf("lamp_%u", n);
    lamp->part = mem_calloc(1, sizeof *lamp->part);
    lamp->part_count = 1;
    lamp->part->roughness = LAMP_ROUGHNESS;
    rgb radiance = virtual_object_color(s, "lamp", n, "radiance");
    double lumen = virtual_object_number(s, "lamp", n, "lumen");
    lamp->part->emission =
        lumen > 0.0 ? radiance_of_flux(s, lumen, solid * mesh_area(&lamp->mesh), radiance) : radiance;
    return STATUS_OK;
}

enum status virtual_objects_read(const struct relight_job *job, const struct compass *compass, const double offset[3],
                                 struct parallel *pool, struct virtual_objects *t, struct error *err) {
    size_t lamps, inserts;
    uint32_t *lamp = render_settings_family(job->settings, "lamp.", &lamps);
    uint32_t *insert = render_settings_family(job->settings, "insert.", &inserts);
    enum status status = STATUS_OK;
    *t = (struct virtual_objects){.object = mem_calloc(lamps + inserts, sizeof *t->object)};
    for (size_t i = 0; i < lamps + inserts && status == STATUS_OK; i++) {
        struct virtual_object *object = &t->object[t->count++];
        status = i < lamps ? make_lamp(job->settings, lamp[i], compass, offset, object, err)
                           : mesh_object_make(job, insert[i - lamps], compass, offset, pool, object, t, err);
    }
    mem_free(lamp);
    mem_free(insert);
    if (status != STATUS_OK)
        virtual_objects_release(t);
    return status;
}
