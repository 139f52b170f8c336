/* segment_light.h, bounced_light.h, light_point.h: what sources send to points, against closed forms. A sphere over a
 * floor; a lamp that shines at an unseen ceiling only; one in an unseen box with a hole; a sky through a hole in the
 * ceiling, all of it and by cell, of the sky and of a box around the room; nothing behind a wall; and the joint fit
 * finds the sky's radiance from these responses, which noise would make too small. sky_doubt.h: half of that sky, of
 * bright texels alone. */
#include "server/light/bounced_light.h"
#include "server/light/joint_fit.h"
#include "server/light/sky_doubt.h"
#include "server/render/bsdf.h"
#include "server/scene/rgb_half.h"
#include "server/state/evidence.h"
#include "tests/check.h"
#include "tests/render/small_room.h"

#define WALL 4
#define WALL_AT 2.0f /* x of a wall across the room, from floor to ceiling */
#define RADIUS 0.1f
#define STACKS 12 /* of the sphere's tessellation */
#define SLICES 24
#define HOLE 1.0f /* side of the hole, from (.5, 3, 1) on */
#define SKY 8.0f
#define PARTS 40 /* of the hole along each side, in the closed form by cell */

/* A reconstruction in which the floor is observed, and all that these units ask of one. */
struct rig {
    struct scene scene;
    struct model model;
    struct reconstruction r;
    struct parallel *pool;
};

static void rig_init(struct rig *g) {
    g->pool = parallel_new(0);
    model_init(&g->model, &g->scene.mesh, 128, 0.5f, g->pool);
    model_light(&g->model, &g->scene.mesh, rgb_gray(0.0f), NULL, g->pool);
    size_t texels = (size_t)g->model.atlas.width * g->model.atlas.height;
    g->r = (struct reconstruction){.scene = &g->scene, .pool = g->pool};
    g->r.segments = g->model.segments, g->r.atlas = g->model.atlas, g->r.inverse = g->model.inverse;
    g->r.materials = g->model.materials, g->r.world = g->model.world;
    g->r.fused = (struct fused){.width = g->model.atlas.width, .height = g->model.atlas.height};
    g->r.fused.radiance = mem_calloc(texels, sizeof *g->r.fused.radiance);
    g->r.fused.count = mem_calloc(texels, sizeof *g->r.fused.count);
    g->r.fused.is_bound = mem_calloc(texels, sizeof *g->r.fused.is_bound);
    for (size_t i = 0; i < g->model.inverse.valid_count; i++) {
        uint32_t texel = g->model.inverse.valid[i];
        g->r.fused.count[texel] = g->r.segments.id[reconstruction_segment(&g->r, texel)] == FLOOR;
    }
}

static void rig_release(struct rig *g) {
    mem_free(g->r.fused.is_bound);
    mem_free(g->r.fused.count);
    mem_free(g->r.fused.radiance);
    g->model.world = g->r.world; /* as the test has left it */
    model_release(&g->model);
    scene_release(&g->scene);
    parallel_free(g->pool);
}

/* --- a sphere over a floor ----------------------------------------------------------------------------------- */

static const vec3 centre = {1.0f, 1.0f, 1.5f};

static vec3 on_sphere(uint32_t stack, uint32_t slice) {
    float down = BSDF_PI * (float)stack / STACKS, around = 2.0f * BSDF_PI * (float)slice / SLICES;
    vec3 d = {sinf(down) * cosf(around), cosf(down), sinf(down) * sinf(around)};
    return vec3_mad(centre, RADIUS, d);
}

static void add_triangle(struct mesh *m, vec3 a, vec3 b, vec3 c) {
    size_t i = m->triangle_count++;
    const vec3 corner[3] = {a, b, c};
    for (uint32_t k = 0; k < 3; k++) {
        m->index[i][k] = (uint32_t)m->vertex_count;
        m->position[m->vertex_count++] = corner[k];
    }
    m->face[i] = (uint32_t)i;
    m->object_id[i] = LAMP;
}

static void add_sphere(struct mesh *m) {
    for (uint32_t i = 0; i < STACKS; i++) {
        for (uint32_t k = 0; k < SLICES; k++) {
            vec3 a = on_sphere(i, k), b = on_sphere(i + 1, k), c = on_sphere(i + 1, k + 1), d = on_sphere(i, k + 1);
            if (i > 0)
                add_triangle(m, a, d, c);
            if (i + 1 < STACKS)
                add_triangle(m, a, c, b);
        }
    }
    m->face_count = m->triangle_count;
}

/* Points of the floor, one for each of its texels; the caller's. */
static struct light_point *floor_points(const struct rig *g, size_t *count) {
    struct light_point *point = mem_calloc(g->model.inverse.valid_count, sizeof *point);
    *count = 0;
    for (size_t i = 0; i < g->model.inverse.valid_count; i++) {
        uint32_t texel = g->model.inverse.valid[i];
        if (g->r.fused.count[texel] > 0.0f &&
            surface_at_texel(&g->scene.mesh, &g->r.atlas, &g->r.inverse, texel, &point[*count].at))
            ++*count;
    }
    return point;
}

/* L r^2 h / d^3, exact for a sphere wholly above the floor; times what the diffuse lobe sends more of grazing light. */
static float sphere_over(vec3 p) {
    vec3 way = vec3_sub(centre, p);
    float square = vec3_dot(way, way), far_m = sqrtf(square);
    return irradiance_matt(way.y / far_m) * RADIUS * RADIUS * way.y / (square * far_m);
}

/* What a lamp sends as a source is what it sends as known light, also where it grazes the surface. */
static void test_grazing(void) {
    struct rig g = {0};
    struct segment_light light;
    double sum[2] = {0.0, 0.0};
    start_room(&g.scene.mesh, 6);
    add_quad(&g.scene.mesh, LAMP, (vec3){0, 0.2f, 1}, (vec3){0, 0.2f, 0}, (vec3){0, 0, 1});
    rig_init(&g);
    segment_light_init(&light, &g.r);
    size_t count, lamp = 0;
    struct light_point *point = floor_points(&g, &count);
    float *lit = mem_calloc(count + 1, sizeof *lit);
    for (size_t s = 0; s < g.r.segments.count; s++)
        lamp = g.r.segments.id[s] == LAMP ? s : lamp;
    segment_light_add(&light, point, count, (uint32_t)lamp, SEGMENT_LIGHT_POINTS, lit);
    g.r.materials.emission[lamp] = rgb_gray(1.0f);
    world_update_lights(&g.r.world);
    struct light_field field = {&g.r.world, (const uint16_t(*)[3])g.r.fused.radiance, NULL, NULL};
    struct incident *in = mem_array(1, sizeof *in);
    for (size_t i = 0; i < count; i += 4) {
        struct irradiance known;
        if (point[i].at.position.x < 1.0f)
            continue;
        irradiance_gather(&known, in, &field, &point[i].at, (uint32_t)i, 256);
        sum[0] += (double)lit[i];
        sum[1] += (double)irradiance_diffuse(&known, point[i].at.shading, 1.0f, point[i].at.shading).g;
    }
    printf("grazing: %.3f of what is gathered\n", sum[0] / sum[1]);
    CHECK_NEAR(sum[0] / sum[1], 1.0, 0.05);
    mem_free(in);
    mem_free(lit);
    mem_free(point);
    segment_light_release(&light);
    rig_release(&g);
}

static void test_sphere(void) {
    struct rig g = {0};
    struct segment_light light;
    double sum[2] = {0.0, 0.0}, worst = 0.0;
    start_room(&g.scene.mesh, 6 * STACKS * SLICES);
    add_quad(&g.scene.mesh, WALL, (vec3){WALL_AT, 0, 0}, (vec3){0, 0, 3}, (vec3){0, 3, 0});
    add_sphere(&g.scene.mesh);
    rig_init(&g);
    segment_light_init(&light, &g.r);
    size_t count, hidden = 0, lamp = 0;
    struct light_point *point = floor_points(&g, &count);
    float *lit = mem_calloc(count + 1, sizeof *lit);
    for (size_t s = 0; s < g.r.segments.count; s++)
        lamp = g.r.segments.id[s] == LAMP ? s : lamp;
    segment_light_add(&light, point, count, (uint32_t)lamp, SEGMENT_LIGHT_POINTS, lit);
    for (size_t i = 0; i < count; i++) {
        if (point[i].at.position.x > WALL_AT) {
            CHECK_THAT(lit[i] == 0.0f, "%g behind the wall", (double)lit[i]);
            hidden++;
            continue;
        }
        double wanted = (double)sphere_over(point[i].at.position);
        sum[0] += (double)lit[i], sum[1] += wanted;
        worst = fmax(worst, fabs((double)lit[i] / wanted - 1.0));
    }
    CHECK(hidden > 100 && count - hidden > 100);
    printf("sphere: %.3f of the closed form, at worst off by %.2f\n", sum[0] / sum[1], worst);
    CHECK_NEAR(sum[0] / sum[1], 1.0, 0.03);
    CHECK_THAT(worst < 0.15, "off by %g", worst);
    mem_free(lit);
    mem_free(point);
    segment_light_release(&light);
    rig_release(&g);
}

/* --- by way of unseen surfaces -------------------------------------------------------------------------------- */

#define CEILING_ALBEDO 0.6f
#define LAMP_SIDE 0.02f
#define BOX_SIDE 0.4f /* inside; its hole is in the floor */
#define BOX_HOLE 0.1f
#define BOX_ALBEDO 0.8f

static size_t segment_of(const struct rig *g, int64_t object) {
    size_t found = 0;
    for (size_t s = 0; s < g->r.segments.count; s++)
        found = g->r.segments.id[s] == object ? s : found;
    return found;
}

/* Light of the lamp at the floor's points by way of one object's surfaces of an albedo, all others being black; as many
 * particles fall on the floor or a black surface. The caller's. */
static float *bounced_at(const struct rig *g, const struct light_point *point, size_t count, int64_t object,
                         float albedo_of) {
    struct segment_light light;
    struct segment_light_disc *disc = mem_array(BOUNCED_MAX, sizeof *disc);
    float *lit = mem_calloc(count + 1, sizeof *lit), albedo[OBJECTS] = {0};
    size_t lamp = segment_of(g, LAMP);
    segment_light_init(&light, &g->r);
    albedo[segment_of(g, object)] = albedo_of;
    size_t discs = bounced_light_find(&light, (uint32_t)lamp, albedo, disc);
    segment_light_add_discs(&light, point, count, disc, discs, lit);
    segment_light_release(&light);
    mem_free(disc);
    return lit;
}

/* A small lamp close below the ceiling, which it faces, is a Lambertian spot of the ceiling: a A h^2 / (pi d^4). */
static void test_ceiling(void) {
    struct rig g = {0};
    double sum[2] = {0.0, 0.0};
    const vec3 at = {1.0f, 3.0f, 1.5f};
    start_room(&g.scene.mesh, 6);
    add_quad(&g.scene.mesh, WALL, (vec3){WALL_AT, 0, 0}, (vec3){0, 0, 3}, (vec3){0, 3, 0});
    add_quad(&g.scene.mesh, LAMP, vec3_sub(at, (vec3){0.5f * LAMP_SIDE, 0.1f, 0.5f * LAMP_SIDE}),
             (vec3){0, 0, LAMP_SIDE}, (vec3){LAMP_SIDE, 0, 0});
    rig_init(&g);
    size_t count, hidden = 0;
    struct light_point *point = floor_points(&g, &count);
    float *lit = bounced_at(&g, point, count, 1, CEILING_ALBEDO);
    for (size_t i = 0; i < count; i++) {
        vec3 way = vec3_sub(at, point[i].at.position);
        double square = (double)vec3_dot(way, way);
        if (point[i].at.position.x > WALL_AT + 0.3f) {
            CHECK_THAT(lit[i] == 0.0f, "%g behind the wall", (double)lit[i]);
            hidden++;
        } else if (point[i].at.position.x < WALL_AT - 0.1f) {
            sum[0] += (double)lit[i];
            sum[1] += (double)(irradiance_matt(way.y / sqrtf((float)square)) * CEILING_ALBEDO * LAMP_SIDE * LAMP_SIDE *
                               way.y * way.y) /
                      (PI * square * square);
        }
    }
    CHECK(hidden > 100 && count - hidden > 100);
    printf("by way of a ceiling: %.3f of the closed form\n", sum[0] / sum[1]);
    CHECK_NEAR(sum[0] / sum[1], 1.0, 0.05);
    mem_free(lit);
    for (size_t i = 0; i < g.model.inverse.valid_count; i++)
        g.r.fused.count[g.model.inverse.valid[i]] = 1.0f;
    lit = bounced_at(&g, point, count, 1, CEILING_ALBEDO);
    for (size_t i = 0; i < count; i++)
        CHECK_THAT(lit[i] == 0.0f, "%g by way of what photographs show", (double)lit[i]);
    mem_free(lit);
    mem_free(point);
    rig_release(&g);
}

/* A lamp in a box: about uniform radiance a A / (S (1 - a (1 - h))) inside, by way of surfaces of area S of which h is
 * a hole, Ulbricht's formula of the integrating sphere. What leaves by the hole falls on the floor below. */
static void test_box(void) {
    struct rig g = {0};
    struct mesh *m = &g.scene.mesh;
    const float s = BOX_SIDE, e = 0.5f * (BOX_SIDE - BOX_HOLE), h = BOX_HOLE;
    const vec3 o = {1.0f, 2.0f, 1.0f}, x = {s, 0, 0}, y = {0, s, 0}, z = {0, 0, s};
    start_room(m, 14);
    add_quad(m, WALL, vec3_add(o, y), x, z); /* all face inwards */
    add_quad(m, WALL, o, y, z);
    add_quad(m, WALL, vec3_add(o, x), z, y);
    add_quad(m, WALL, o, x, y);
    add_quad(m, WALL, vec3_add(o, z), y, x);
    add_quad(m, WALL, o, z, (vec3){e, 0, 0});
    add_quad(m, WALL, vec3_add(o, (vec3){e + h, 0, 0}), z, (vec3){e, 0, 0});
    add_quad(m, WALL, vec3_add(o, (vec3){e, 0, 0}), (vec3){0, 0, e}, (vec3){h, 0, 0});
    add_quad(m, WALL, vec3_add(o, (vec3){e, 0, e + h}), (vec3){0, 0, e}, (vec3){h, 0, 0});
    add_quad(m, LAMP, vec3_add(o, (vec3){0.05f, 0.1f, 0.05f}), (vec3){0, 0, LAMP_SIDE}, (vec3){LAMP_SIDE, 0, 0});
    rig_init(&g);
    size_t count;
    struct light_point *point = floor_points(&g, &count);
    float *lit = bounced_at(&g, point, count, WALL, BOX_ALBEDO);
    double area = 6.0 * (double)(s * s), hole = (double)(h * h) / area, a = (double)BOX_ALBEDO, found = 0.0;
    double radiance = a * (double)(LAMP_SIDE * LAMP_SIDE) / (area * (1.0 - a * (1.0 - hole))), wanted = 0.0;
    const vec3 middle = vec3_add(o, (vec3){0.5f * s, 0, 0.5f * s});
    for (size_t i = 0; i < count; i++) {
        vec3 way = vec3_sub(middle, point[i].at.position);
        double square = (double)vec3_dot(way, way);
        found += (double)lit[i];
        wanted += radiance * (double)(h * h * way.y * way.y) / (PI * square * square);
    }
    printf("out of a box: %.3f of the closed form\n", found / wanted);
    CHECK_NEAR(found / wanted, 1.0, 0.2);
    mem_free(lit);
    mem_free(point);
    rig_release(&g);
}

/* --- a sky through a hole ------------------------------------------------------------------------------------ */

/* The ceiling but for the hole; the other walls are those of start_room. */
static void make_room_with_hole(struct mesh *m) {
    start_room(m, 16);
    m->vertex_count -= 12, m->triangle_count -= 6; /* all but the floor again */
    vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    add_quad(m, 2, (vec3){0, 0, 0}, y, z);
    add_quad(m, 3, x, z, y);
    add_quad(m, 5, (vec3){0, 0, 0}, x, y);
    add_quad(m, 5, z, y, x);
    add_quad(m, 1, y, (vec3){0.5f, 0, 0}, z);
    add_quad(m, 1, (vec3){0.5f + HOLE, 3, 0}, (vec3){3.5f - HOLE, 0, 0}, z);
    add_quad(m, 1, (vec3){0.5f, 3, 0}, (vec3){HOLE, 0, 0}, (vec3){0, 0, 1});
    add_quad(m, 1, (vec3){0.5f, 3, 1.0f + HOLE}, (vec3){HOLE, 0, 0}, (vec3){0, 0, 2.0f - HOLE});
    add_quad(m, WALL, (vec3){WALL_AT, 0, 0}, z, y);
    add_lamp(m);
    for (size_t i = 0; i < 4; i++) /* out of the way */
        m->position[m->vertex_count - 1 - i].y = -1.0f;
}

/* Adds the form factors from a floor point to the parts of the hole that lie in each cell; returns their sum. */
static double hole_factors(vec3 p, double cell[SKY_CELLS]) {
    double sum = 0.0, area = (double)(HOLE * HOLE) / (PARTS * PARTS);
    for (int i = 0; i < PARTS * PARTS; i++) {
        vec3 at = {0.5f + HOLE * ((float)(i % PARTS) + 0.5f) / PARTS, 3.0f,
                   1.0f + HOLE * ((float)(i / PARTS) + 0.5f) / PARTS};
        vec3 way = vec3_sub(at, p);
        double square = (double)vec3_dot(way, way);
        double factor = (double)irradiance_matt(way.y / sqrtf((float)square)) * area * (double)(way.y * way.y) /
                        (PI * square * square);
        struct sky_corners c = sky_cells_around(vec3_normalize(way));
        for (int k = 0; k < 4; k++)
            cell[c.cell[k]] += factor * (double)c.weight[k];
        sum += factor;
    }
    return sum;
}

/* The same for the cells of a box. */
static double hole_parts(vec3 p, const struct surround *surround, double cell[SURROUND_CELLS]) {
    double sum = 0.0, area = (double)(HOLE * HOLE) / (PARTS * PARTS);
    for (int i = 0; i < PARTS * PARTS; i++) {
        vec3 at = {0.5f + HOLE * ((float)(i % PARTS) + 0.5f) / PARTS, 3.0f,
                   1.0f + HOLE * ((float)(i / PARTS) + 0.5f) / PARTS};
        vec3 way = vec3_sub(at, p);
        double square = (double)vec3_dot(way, way), factor = area * (double)(way.y * way.y) / (PI * square * square);
        cell[surround_cell(surround, p, vec3_normalize(way))] += factor;
        sum += factor;
    }
    return sum;
}

/* The sky's radiance, from what a floor of albedo .5 shows under the closed form's light. */
static double fit_sky(const struct rig *g, const struct light_points *points) {
    struct joint_point *joint = mem_array(points->count, sizeof *joint);
    float *lit = mem_array(points->count, sizeof *lit);
    struct joint_fit fit;
    for (size_t i = 0; i < points->count; i++) {
        const struct light_point *p = &points->point[i];
        double cell[SKY_CELLS] = {0};
        float light = p->at.position.x > WALL_AT ? 0.0f : SKY * (float)hole_factors(p->at.position, cell);
        joint[i] = (struct joint_point){p->segment, p->patch, 0.5f * (0.1f + light), 0.1f, 0.05f};
        lit[i] = p->escaping;
    }
    joint_fit_init(&fit, joint, points->count, 2, g->pool);
    joint_fit_add(&fit, &(struct joint_source){log(1.0), 2.0, -INFINITY, log(1.0), 0.0}, lit);
    joint_fit_solve(&fit);
    double found = exp(fit.source[1].value);
    joint_fit_release(&fit);
    mem_free(lit);
    mem_free(joint);
    return found;
}

static void compare_sky(const struct light_points *points) {
    double cell[2][SKY_CELLS] = {{0}}, sum[2] = {0.0, 0.0};
    for (size_t i = 0; i < points->count; i++) {
        const struct light_point *p = &points->point[i];
        if (p->at.position.x > WALL_AT + 0.3f) {
            CHECK_THAT(p->escaping == 0.0f, "%g behind the wall", (double)p->escaping);
            continue;
        }
        sum[0] += (double)p->escaping;
        for (size_t k = 0; k < SKY_CELLS && p->sky; k++)
            cell[0][k] += (double)p->sky[k];
        if (p->at.position.x < WALL_AT)
            sum[1] += hole_factors(p->at.position, cell[1]);
    }
    CHECK_NEAR(sum[0] / sum[1], 1.0, 0.02);
    for (size_t k = 0; k < SKY_CELLS; k++)
        CHECK_THAT(fabs(cell[0][k] - cell[1][k]) < 0.03 * cell[1][k] + 0.003 * sum[1], "cell %zu: %g, %g", k,
                   cell[0][k], cell[1][k]);
}

static void test_sky(void) {
    struct rig g = {0};
    struct survey survey;
    struct light_sky sky;
    struct light_points points;
    make_room_with_hole(&g.scene.mesh);
    rig_init(&g);
    light_sky_init(&sky, &g.r.environment);
    survey_init(&survey, &g.r, NULL, NULL, NULL, 1600);
    light_points_init(&points, &survey, &sky, NULL, 0.1f);
    survey_release(&survey);
    CHECK(points.count > 300);
    compare_sky(&points);
    double found = fit_sky(&g, &points);
    printf("sky of %g: %.2f\n", (double)SKY, found);
    CHECK_NEAR(found, (double)SKY, 0.05 * (double)SKY);
    light_points_release(&points);
    light_sky_release(&sky);
    rig_release(&g);
}

/* --- doubt about a sky that no photograph shows -------------------------------------------------------------- */

/* Of the floor between two places along x: mean radiance of white texels by the half of a sky of radiance SKY towards
 * -x, by the closed form and by sky_doubt; the other half was seen. */
static double doubt_between(const struct rig *g, float from, float to, double *wanted) {
    uint32_t *texel = mem_array(g->model.inverse.valid_count + 1, sizeof *texel);
    size_t count = 0, bright = 0;
    *wanted = 0.0;
    for (size_t i = 0; i < g->model.inverse.valid_count; i++) {
        struct surface_point at;
        uint32_t t = g->model.inverse.valid[i];
        if (!(g->r.fused.count[t] > 0.0f) || !surface_at_texel(&g->scene.mesh, &g->r.atlas, &g->r.inverse, t, &at) ||
            at.position.x < from || at.position.x > to)
            continue;
        texel[count++] = t;
        if (!evidence_is_bright(&g->r, t))
            continue;
        double area = (double)(HOLE * HOLE) / (PARTS * PARTS);
        for (int k = 0; k < PARTS * PARTS; k++) {
            vec3 way = vec3_sub((vec3){0.5f + HOLE * ((float)(k % PARTS) + 0.5f) / PARTS, 3.0f,
                                       1.0f + HOLE * ((float)(k / PARTS) + 0.5f) / PARTS},
                                at.position);
            double square = (double)vec3_dot(way, way);
            *wanted += way.x < 0.0f ? (double)SKY * area * (double)(way.y * way.y) / (PI * square * square) : 0.0;
        }
        bright++;
    }
    *wanted /= fmax((double)bright, 1.0);
    double found = (double)sky_doubt(&g->r, texel, count);
    mem_free(texel);
    return found;
}

/* Texels near the wall are bright, as a lamp is; what the sky may send to all others does not count. */
static void test_doubt(void) {
    struct rig g = {0};
    struct environment *e = &g.r.environment;
    make_room_with_hole(&g.scene.mesh);
    rig_init(&g);
    environment_make_empty(e, 64);
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        for (size_t c = 0; c < 3; c++)
            e->map.pixel[3 * i + c] = SKY;
        e->confidence.pixel[2 * i] = environment_pixel_direction(e, i).x > 0.0f;
    }
    world_set_environment(&g.r.world, &e->map, g.pool);
    g.r.evidence = mem_calloc(g.r.segments.count, sizeof *g.r.evidence);
    for (size_t s = 0; s < g.r.segments.count; s++)
        evidence_set_radiance(&g.r.evidence[s], rgb_gray(1.0f));
    for (size_t i = 0; i < g.model.inverse.valid_count; i++) {
        struct surface_point at;
        uint32_t texel = g.model.inverse.valid[i];
        if (surface_at_texel(&g.scene.mesh, &g.r.atlas, &g.r.inverse, texel, &at) && at.position.x > 1.6f)
            rgb_to_half(g.r.fused.radiance[texel], rgb_gray(1.0f));
    }
    double wanted, all;
    double near_wall = doubt_between(&g, 0.0f, WALL_AT - 0.1f, &wanted), left = doubt_between(&g, 0.0f, 1.0f, &all);
    printf("doubt: %.3f (%.3f), beyond the hole %.3f\n", near_wall, wanted, left);
    CHECK_NEAR(near_wall, wanted, 0.15 * wanted);
    CHECK_THAT(left < 0.5 * near_wall, "%g, %g: the test is too easy", left, near_wall);
    CHECK(doubt_between(&g, WALL_AT + 0.3f, 4.0f, &wanted) == 0.0);
    mem_free(g.r.evidence);
    environment_release(e);
    rig_release(&g);
}

/* --- a box around the room with the hole ---------------------------------------------------------------------- */

/* A cell of the box's upper side, just above the ceiling, sends through its part of the hole. */
static void test_surround(void) {
    struct rig g = {0};
    struct survey survey;
    struct light_sky sky;
    struct light_points points;
    struct surround surround;
    struct views views = {.scene = &g.scene};
    make_room_with_hole(&g.scene.mesh);
    for (size_t i = 0; i < 4; i++) /* the lamp, which lies below the room */
        g.scene.mesh.position[g.scene.mesh.vertex_count - 1 - i].y = 0.0f;
    rig_init(&g);
    surround_init(&surround, &views);
    light_sky_init(&sky, &g.r.environment);
    sky.surround = &surround;
    survey_init(&survey, &g.r, NULL, NULL, NULL, 1600);
    light_points_init(&points, &survey, &sky, NULL, 0.1f);
    survey_release(&survey);
    double found[SURROUND_CELLS] = {0}, wanted[SURROUND_CELLS] = {0}, sum = 0.0;
    for (size_t i = 0; i < points.count; i++) {
        const struct light_point *p = &points.point[i];
        if (p->at.position.x > WALL_AT)
            continue;
        for (size_t k = 0; k < SURROUND_CELLS && p->sky; k++)
            found[k] += (double)p->sky[k];
        sum += hole_parts(p->at.position, &surround, wanted);
    }
    for (size_t k = 0; k < SURROUND_CELLS; k++)
        CHECK_THAT(fabs(found[k] - wanted[k]) < 0.03 * wanted[k] + 0.003 * sum, "cell %zu: %g, %g", k, found[k],
                   wanted[k]);
    light_points_release(&points);
    light_sky_release(&sky);
    rig_release(&g);
}

int main(void) {
    test_sphere();
    test_grazing();
    test_ceiling();
    test_box();
    test_sky();
    test_doubt();
    test_surround();
    return check_result();
}
