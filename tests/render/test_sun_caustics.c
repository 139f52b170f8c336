/* sun_caustics.h: the sun falls slantwise on a polished floor, and what the floor throws onto the wall behind is by
 * Fresnel's equations, worked out here, a beam as wide as the floor. Nothing of it reaches what it does not meet, nor
 * the wall from a rough floor; it is the same for one thread and for several. */
#include "server/gather/sun_caustics.h"
#include "server/render/bsdf.h"
#include "tests/check.h"
#include "tests/render/small_room.h"

#define WALL 3
#define ASIDE 4
#define SIDE 256
#define SPACING 8

struct yard {
    struct mesh mesh;
    struct model model;
    struct fused fused; /* every texel is seen */
};

/* A floor of 4 x 3 m, a wall along its far end, and one beside it, along the sun's way. */
static void yard_init(struct yard *y, struct parallel *pool) {
    *y = (struct yard){0};
    start_room(&y->mesh, OBJECTS);
    y->mesh.triangle_count = 2; /* the floor alone */
    y->mesh.vertex_count = 4;
    add_quad(&y->mesh, WALL, (vec3){4, 0, 0}, (vec3){0, 0, 3}, (vec3){0, 3, 0});
    add_quad(&y->mesh, ASIDE, (vec3){0, 0, -0.5f}, (vec3){4, 0, 0}, (vec3){0, 3, 0});
    model_init(&y->model, &y->mesh, SIDE, 0.5f, pool);
    model_light(&y->model, &y->mesh, rgb_gray(0.0f), NULL, pool);
    y->fused.width = y->fused.height = SIDE;
    y->fused.count = mem_array(SIDE * SIDE, sizeof *y->fused.count);
    for (size_t i = 0; i < SIDE * SIDE; i++)
        y->fused.count[i] = 1.0f;
}

static void yard_release(struct yard *y) {
    fused_release(&y->fused);
    model_release(&y->model);
    mesh_release(&y->mesh);
}

/* Mean and standard deviation of the irradiance at an object's probes; inside: not within 20 cm of its rim. */
struct arrives {
    double mean[3], deviation;
    double share; /* of all light, of which there is no other */
};

static struct arrives arrives_at(const struct yard *y, const struct probes *probes, int64_t object) {
    struct arrives a = {{0.0, 0.0, 0.0}, 0.0, 0.0};
    double count = 0.0, squares = 0.0;
    for (size_t i = 0; i < probes->count; i++) {
        struct surface_point at;
        CHECK(surface_at_texel(&y->mesh, &y->model.atlas, &y->model.inverse, probes->probe[i].texel, &at));
        vec3 p = at.position;
        if (y->mesh.object_id[at.triangle] != object || p.y < 0.2f || p.y > 2.8f ||
            (object == WALL && (p.z < 0.2f || p.z > 2.8f)))
            continue;
        for (int c = 0; c < 3; c++)
            a.mean[c] += (double)probes->probe[i].light.moment[0][c];
        squares += pow((double)probes->probe[i].light.moment[0][0], 2.0);
        count += 1.0;
    }
    for (int c = 0; c < 3; c++)
        a.mean[c] /= count;
    a.deviation = sqrt(fmax(squares / count - a.mean[0] * a.mean[0], 0.0));
    return a;
}

static struct arrives mirrored(struct yard *y, float roughness, float specular, int64_t object, int threads) {
    struct sun sun = {.is_there = true,
                      .direction = vec3_normalize((vec3){-1, 1, 0}),
                      .radius_rad = 0.005f,
                      .irradiance = {10.0f, 8.0f, 5.0f}};
    struct parallel *pool = parallel_new(threads);
    struct probes probes;
    y->model.materials.roughness[0] = roughness;
    y->model.materials.specular[0] = specular;
    probes_init(&probes, SPACING, &y->mesh, &y->model.atlas, &y->model.inverse, &y->fused);
    double share = sun_caustics_add(&probes, &sun, &y->model.world, &y->mesh, &y->model.inverse, 1, pool);
    struct arrives a = arrives_at(y, &probes, object);
    a.share = share;
    probes_release(&probes);
    parallel_free(pool);
    return a;
}

/* Unpolarised, from air at 45 degrees. */
static double fresnel_45(double eta) {
    double c = sqrt(0.5), t = sqrt(1.0 - 0.5 / (eta * eta));
    double across = (c - eta * t) / (c + eta * t), along = (eta * c - t) / (eta * c + t);
    return 0.5 * (across * across + along * along);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct yard y;
    yard_init(&y, pool);
    /* Specular .5 is an index of refraction of 1.5, 1 one of 1.7888. */
    static const double eta[2] = {1.5, 1.78885};
    for (int k = 0; k < 2; k++) {
        struct arrives a = mirrored(&y, 0.1f, k == 0 ? 0.5f : 1.0f, WALL, 0);
        double expected = fresnel_45(eta[k]) * sqrt(0.5) * 10.0;
        printf("index %.2f: %.4f at the wall (%.4f), from probe to probe %.4f\n", eta[k], a.mean[0], expected,
               a.deviation);
        CHECK_NEAR(a.mean[0], expected, 0.02 * expected);
        CHECK_NEAR(a.mean[1], 0.8 * expected, 0.02 * expected);
        CHECK_NEAR(a.mean[2], 0.5 * expected, 0.02 * expected);
        CHECK_THAT(a.deviation < 0.15 * expected, "%g", a.deviation);
    }
    struct arrives aside = mirrored(&y, 0.1f, 1.0f, ASIDE, 0), rough = mirrored(&y, 0.9f, 1.0f, WALL, 0);
    struct arrives matt = mirrored(&y, 0.1f, 0.0f, WALL, 0);
    struct arrives one = mirrored(&y, 0.3f, 1.0f, WALL, 1), several = mirrored(&y, 0.3f, 1.0f, WALL, 3);
    CHECK_THAT(aside.mean[0] < 0.01, "%g", aside.mean[0]);
    CHECK(rough.mean[0] == 0.0 && matt.mean[0] == 0.0 && matt.share == 0.0 && one.share == 1.0);
    CHECK(one.mean[0] > 0.1 && one.mean[0] == several.mean[0]);
    yard_release(&y);
    parallel_free(pool);
    return check_result();
}
