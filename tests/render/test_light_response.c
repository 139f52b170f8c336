/* segment_light.h, bounced_light.h, light_point.h: what lamps send to points, against closed forms. A sphere over a
 * floor; a lamp that shines at an unseen ceiling only; one in an unseen box with a hole. */
#include "server/light/bounced_light.h"
#include "server/render/bsdf.h"
#include "tests/render/light_response_rig.h"

#define RADIUS 0.1f
#define STACKS 12 /* of the sphere's tessellation */
#define SLICES 24

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

int main(void) {
    test_sphere();
    test_grazing();
    test_ceiling();
    test_box();
    return check_result();
}
