/* Emitters that show a picture: light samples and hits read the same place of it, paths are linear in it, and
 * reconstruction finds it from photographs (emission_pattern.h), for any number of threads and anew after a
 * checkpoint. Where the lamp is equally bright all over, none is found. In the long form (UNBAKE_LONG) a whole
 * reconstruction by several numbers of threads. */
#include "server/material/emission_pattern.h"
#include "server/reconstruct/inputs.h"
#include "server/render/bsdf.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define TEXTURE 128

/* Smooth, so that a bilinear look-up is nearly exact; in the mean 1. */
static rgb waves(vec3 place) {
    float u = place.x - 1.5f, v = place.z - 1.0f, wave = cosf(6.2832f * u), other = cosf(6.2832f * v);
    return rgb_make(1.0f + 0.7f * wave, 1.0f + 0.5f * other, 1.0f - 0.6f * wave);
}

static rgb opposite(vec3 place) { return rgb_sub(rgb_gray(2.0f), waves(place)); }

/* A bright half and a dark one. */
static rgb halves(vec3 place) { return rgb_gray(place.x < 2.0f ? 1.7f : 0.3f); }

/* Linear, so that a bilinear look-up is exact but at the rim. */
static rgb slope(vec3 place) {
    return rgb_make(1.0f + 1.6f * (place.x - 2.0f), 1.0f - 1.6f * (place.x - 2.0f), 1.0f + 1.6f * (place.z - 1.5f));
}

/* The room, ready to be rendered, whose lamp shows a picture, or none. */
static void lit_model(struct model *m, const struct mesh *mesh, rgb picture(vec3), struct parallel *pool) {
    model_init(m, mesh, TEXTURE, 0.5f, pool);
    if (picture)
        model_show_picture(m, mesh, picture);
    model_light(m, mesh, lamp_radiance, NULL, pool);
}

static void test_placement(struct parallel *pool) {
    struct mesh mesh;
    struct model m;
    make_mesh(&mesh);
    lit_model(&m, &mesh, waves, pool);
    CHECK(m.world.lights->triangle_count > 2); /* parts of triangles: the picture is read through them */
    size_t hits = 0;
    for (int i = 0; i < 500; i++) {
        float u = fmodf((float)i * 0.7549f, 1.0f), v = fmodf((float)i * 0.5698f, 1.0f);
        vec3 from = spread(i, 0.2f);
        struct light_sample s;
        struct accel_hit hit;
        lights_sample(m.world.lights, from, fmodf((float)i * 0.8192f, 1.0f), u, v, &s);
        if (!(s.pdf > 0.0f) || !accel_intersect(m.world.accel, from, s.direction, 0.0f, INFINITY, &hit))
            continue;
        vec2 at = atlas_point(&m.atlas, hit.triangle, hit.b1, hit.b2);
        rgb found = materials_emission(&m.materials, s.segment, at.x, at.y);
        CHECK_RGB(s.radiance, found, 1e-3f);
        CHECK_RGB(found, rgb_mul(lamp_radiance, waves(s.point)), 0.08f);
        hits++;
    }
    CHECK_THAT(hits > 300, "%zu", hits);
    model_release(&m);
    mesh_release(&mesh);
}

static void render(const struct mesh *mesh, rgb picture(vec3), struct parallel *pool, struct image *image) {
    struct model m;
    struct camera camera = look((vec3){3.6f, 2.2f, 2.7f}, (vec3){1.5f, 1.0f, 1.0f});
    const struct path_settings path = {.max_depth = 5, .roulette_depth = 9, .seed = 3};
    lit_model(&m, mesh, picture, pool);
    film_render(&m.world, &camera, 4, &path, 0, pool, image);
    model_release(&m);
}

/* A picture and its opposite add up to twice the lamp without one, path by path: the same places are sampled. */
static void test_linear(struct parallel *pool) {
    struct mesh mesh;
    struct image one, other, plain;
    double difference = 0.0;
    make_mesh(&mesh);
    render(&mesh, waves, pool, &one);
    render(&mesh, opposite, pool, &other);
    render(&mesh, NULL, pool, &plain);
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT * one.channel_count; i += one.channel_count) {
        for (size_t c = 0; c < 3; c++) {
            CHECK_NEAR(one.pixel[i + c] + other.pixel[i + c], 2.0f * plain.pixel[i + c],
                       2e-3f * plain.pixel[i + c] + 1e-4f);
            difference += fabs((double)(one.pixel[i + c] - other.pixel[i + c]));
        }
    }
    CHECK(difference > 1.0);
    image_release(&one);
    image_release(&other);
    image_release(&plain);
    mesh_release(&mesh);
}

/* Radiance that a place of the floor sends to `wo` by the lamp's light alone: a sum over a grid of the lamp's
 * places. */
static rgb direct_light(const struct model *m, vec3 floor, vec3 wo) {
    enum { SIDE = 200 };
    rgb sum = {0.0f, 0.0f, 0.0f}, base = rgb_gray(0.5f);
    for (int i = 0; i < SIDE * SIDE; i++) {
        vec3 on = {1.5f + ((float)(i % SIDE) + 0.5f) / SIDE, 2.9f, 1.0f + ((float)(i / SIDE) + 0.5f) / SIDE};
        vec3 to = vec3_sub(on, floor);
        float square = vec3_dot(to, to);
        vec3 wi = vec3_scale(to, 1.0f / sqrtf(square));
        /* The floor's frame: y is up. */
        vec3 a = {wo.z, wo.x, wo.y}, b = {wi.z, wi.x, wi.y};
        struct bsdf bsdf = bsdf_make(base, m->materials.roughness[FLOOR], m->materials.specular[FLOOR], a.z);
        struct bsdf_value f = bsdf_eval(&bsdf, a, b); /* with the cosine there */
        sum = rgb_mad(sum, 0.5f * f.diffuse * wi.y / square / (SIDE * SIDE), rgb_mul(lamp_radiance, slope(on)));
    }
    return sum;
}

/* Paths bring what the picture sheds, place by place of it. */
static void test_direct(struct parallel *pool) {
    enum { PATHS = 2048, ROUNDS = 8 };
    static struct ray ray[PATHS];
    static struct path_key key[PATHS];
    static rgb radiance[PATHS];
    const struct path_settings settings = {.max_depth = 2, .roulette_depth = 9, .seed = 4};
    struct path_batch *batch = path_batch_new_forward(PATHS);
    struct mesh mesh;
    struct model m;
    make_mesh(&mesh);
    lit_model(&m, &mesh, slope, pool);
    for (int place = 0; place < 3; place++) {
        vec3 floor = {0.8f + 1.2f * (float)place, 0.0f, 1.3f}, from = {2.0f, 1.5f, 2.6f};
        vec3 wo = vec3_normalize(vec3_sub(from, floor));
        rgb found = {0.0f, 0.0f, 0.0f};
        for (uint32_t round = 0; round < ROUNDS; round++) {
            for (uint32_t i = 0; i < PATHS; i++) {
                ray[i] = (struct ray){from, vec3_neg(wo)};
                key[i] = (struct path_key){(uint32_t)place, round, i};
            }
            path_batch_trace(batch, &m.world, &settings, PATHS, ray, key, radiance);
            for (int i = 0; i < PATHS; i++)
                found = rgb_mad(found, 1.0f / (PATHS * ROUNDS), radiance[i]);
        }
        CHECK_RGB(found, direct_light(&m, floor, wo), 0.01f);
    }
    path_batch_free(batch);
    model_release(&m);
    mesh_release(&mesh);
}

/* What was found of the lamp, in the mean over the texels that lie in each half of it, edges left out. */
struct found {
    rgb bright, dark;
    bool any;
};

static struct found find(const struct reconstruction *r) {
    struct found found = {.any = r->materials.emission_pattern != NULL};
    float bright = 0.0f, dark = 0.0f;
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], s = reconstruction_segment(r, texel);
        struct surface_point at;
        if (r->segments.id[s] != LAMP || !surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at) ||
            fabsf(at.position.x - 2.0f) < 0.15f)
            continue;
        rgb shown = materials_emission_of_texel(&r->materials, s, texel);
        if (at.position.x < 2.0f) {
            found.bright = rgb_add(found.bright, shown);
            bright += 1.0f;
        } else {
            found.dark = rgb_add(found.dark, shown);
            dark += 1.0f;
        }
    }
    found.bright = rgb_scale(found.bright, 1.0f / bright);
    found.dark = rgb_scale(found.dark, 1.0f / dark);
    return found;
}

/* By one thread as by those that found it. */
static void test_restored(struct reconstruction *r, const struct scene *scene) {
    size_t bytes = (size_t)r->atlas.width * r->atlas.height * sizeof *r->materials.emission_pattern;
    uint16_t(*before)[3] = mem_alloc(bytes);
    struct views views;
    memcpy(before, r->materials.emission_pattern, bytes);
    r->pool = parallel_new(1);
    views_init(&views, scene, &r->segments, r->world.accel, r->pool);
    const struct emission_pattern_input input = inputs_of_pattern(r, &views);
    emission_pattern_restore(&input, &r->materials, r->evidence);
    CHECK(r->materials.emission_pattern && memcmp(before, r->materials.emission_pattern, bytes) == 0);
    views_release(&views);
    parallel_free(r->pool);
    r->pool = NULL;
    mem_free(before);
}

static void test_found(struct parallel *pool) {
    struct scene scene = {0};
    lamp_picture = halves;
    make_scene(&scene, pool);
    lamp_picture = NULL;
    const int threads[] = {1, 3};
    struct found found[2];
    for (int i = !IS_LONG; i < 2; i++) {
        struct reconstruction r;
        shell_solve_with(SHELL_SETTINGS("96"), &scene, threads[i], &r);
        for (size_t s = 0; s < r.segments.count; s++)
            CHECK_THAT(r.is_emitter[s] == (r.segments.id[s] == LAMP), "segment %zu", s);
        found[i] = find(&r);
        CHECK(found[i].any);
        /* Its own light: what it reflects of the floor's is less than a twentieth of the dark half's. */
        CHECK_RGB(found[i].bright, rgb_scale(lamp_radiance, 1.7f), 0.06f);
        CHECK_RGB(found[i].dark, rgb_scale(lamp_radiance, 0.3f), 0.25f);
        rgb color = shell_mean_color(&r, FLOOR);
        CHECK_RGB(color, wall_color[FLOOR], 0.06f);
        if (found[i].any)
            test_restored(&r, &scene);
        reconstruct_release(&r);
    }
    CHECK(!IS_LONG || rgb_is_black(rgb_sub(found[0].bright, found[1].bright)));
    CHECK(!IS_LONG || rgb_is_black(rgb_sub(found[0].dark, found[1].dark)));
    scene_release(&scene);
}

static void test_plain(struct parallel *pool) {
    struct scene scene = {0};
    struct reconstruction r;
    make_scene(&scene, pool);
    shell_solve_with(SHELL_SETTINGS("96"), &scene, 0, &r);
    struct found found = find(&r);
    CHECK(!found.any);
    CHECK_RGB(found.dark, lamp_radiance, 0.06f);
    /* Renders of few samples a pixel beside photographs of 64: nearly all of their difference is noise of the former,
     * which is no error. */
    double msre = 0.0, left = 0.0, of_renders = 0.0, of_photographs = 0.0;
    for (size_t i = 0; i < r.held_out_count; i++) {
        msre += r.held_out[i].msre;
        left += r.held_out[i].msre_noise_left * r.held_out[i].msre_noise_left;
        of_renders += r.held_out[i].msre_render_noise;
        of_photographs += r.held_out[i].msre_photograph_noise;
    }
    left = sqrt(left);
    printf("MSRE %g, give or take %g; noise of renders %g, of photographs %g\n", msre, left, of_renders,
           of_photographs);
    CHECK_THAT(fabs(msre - of_photographs) < 4.0 * left + 0.5 * of_photographs, "MSRE %g", msre);
    CHECK_THAT(left < 0.3 * of_renders, "noise left %g", left);
    CHECK(of_photographs > 0.01 * of_renders && of_photographs < 0.3 * of_renders);
    reconstruct_release(&r);
    scene_release(&scene);
}

/* Leaves out of a photograph what lies behind the dark half of the lamp, or before it. */
static void hide_half(struct photograph *photo) {
    vec3 from = camera_origin(&photo->camera), direction;
    photo->mask = mem_array(WIDTH * HEIGHT, sizeof *photo->mask);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        camera_direction(&photo->camera, (float)(i % WIDTH) + 0.5f, (float)(i / WIDTH) + 0.5f, &direction);
        photo->mask[i] = !(direction.y > 0.0f && from.x + (2.9f - from.y) / direction.y * direction.x > 2.0f);
    }
}

/* By exposures of which some saturate far below the lamp, and only these see one half of it: that is not darker for
 * it. */
static void test_exposures(struct parallel *pool) {
    struct scene scene = {0};
    struct reconstruction r;
    make_mesh(&scene.mesh);
    for (size_t i = 0; i < 4; i++) { /* twice as wide, so that more of it is clear of its edges */
        vec3 *corner = &scene.mesh.position[4 * LAMP + i];
        *corner = (vec3){corner->x > 2.0f ? 3.0f : 1.0f, corner->y, corner->z > 1.5f ? 2.5f : 0.5f};
    }
    photograph_mesh(&scene, lamp_radiance, NULL, look_anywhere, pool);
    for (size_t f = 0; f < scene.photograph_count; f++) {
        struct photograph *photo = &scene.photograph[f];
        photo->is_hdr = false;
        photo->clip = 1.0f;
        photo->exposure = f % 3 > 0 ? 0.05f : 0.5f;
        for (size_t i = 0; i < 3 * WIDTH * HEIGHT; i++) {
            uint16_t *value = &photo->pixel[i / 3][i % 3];
            *value = image_half_from_float(fminf(photo->exposure * image_float_from_half(*value), 1.0f));
        }
        if (f % 3 > 0)
            hide_half(photo);
    }
    shell_solve_with(SHELL_SETTINGS("96"), &scene, 0, &r);
    struct found found = find(&r);
    CHECK(!found.any);
    CHECK_RGB(found.dark, lamp_radiance, 0.06f);
    reconstruct_release(&r);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    test_placement(pool);
    test_linear(pool);
    test_direct(pool);
    test_found(pool);
    if (!IS_BRIEF) {
        test_plain(pool);
        test_exposures(pool);
    }
    parallel_free(pool);
    return check_result();
}
