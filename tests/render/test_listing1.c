/* Listing 1 on a small closed room of known materials: what it recovers, that the outcome does
 * not depend on threads, and that a stopped and resumed run ends in the same bytes. */
#include <time.h>

#include "common/mem.h"
#include "common/sha256.h"
#include "server/reconstruct/reconstruct.h"
#include "server/render/film.h"
#include "tests/check.h"

#define OBJECTS 7 /* six walls and a lamp */
#define LAMP 6
#define FRAMES 20
#define WIDTH 48
#define HEIGHT 36

static const rgb wall_color[OBJECTS] = {{0.6f, 0.5f, 0.4f}, {0.8f, 0.8f, 0.8f}, {0.7f, 0.2f, 0.2f},
                                        {0.2f, 0.6f, 0.3f}, {0.7f, 0.7f, 0.6f}, {0.5f, 0.6f, 0.8f},
                                        {0.4f, 0.4f, 0.4f}};
static const rgb lamp_radiance = {9.0f, 8.0f, 6.0f};

static void add_quad(struct mesh *m, int64_t object, vec3 corner, vec3 u, vec3 v) {
    uint32_t first = (uint32_t)m->vertex_count;
    m->position[m->vertex_count++] = corner;
    m->position[m->vertex_count++] = vec3_add(corner, u);
    m->position[m->vertex_count++] = vec3_add(vec3_add(corner, u), v);
    m->position[m->vertex_count++] = vec3_add(corner, v);
    for (uint32_t t = 0; t < 2; t++) {
        size_t i = m->triangle_count++;
        m->index[i][0] = first;
        m->index[i][1] = first + 1 + t;
        m->index[i][2] = first + 2 + t;
        m->face[i] = (uint32_t)i;
        m->object_id[i] = object;
    }
    m->face_count = m->triangle_count;
}

/* A room of 4 x 3 x 3 m, normals inward, a lamp of 1 m^2 under the ceiling. y is up. */
static void make_mesh(struct mesh *m) {
    *m = (struct mesh){0};
    m->position = mem_array(4 * OBJECTS, sizeof *m->position);
    m->index = mem_array(2 * OBJECTS, sizeof *m->index);
    m->face = mem_array(2 * OBJECTS, sizeof *m->face);
    m->object_id = mem_array(2 * OBJECTS, sizeof *m->object_id);
    vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    add_quad(m, 0, (vec3){0, 0, 0}, z, x);
    add_quad(m, 1, (vec3){0, 3, 0}, x, z);
    add_quad(m, 2, (vec3){0, 0, 0}, y, z);
    add_quad(m, 3, (vec3){4, 0, 0}, z, y);
    add_quad(m, 4, (vec3){0, 0, 0}, x, y);
    add_quad(m, 5, (vec3){0, 0, 3}, y, x);
    add_quad(m, LAMP, (vec3){1.5f, 2.9f, 1.0f}, (vec3){1, 0, 0}, (vec3){0, 0, 1});
}

/* A camera at `from` that looks at `to`. */
static struct camera look(vec3 from, vec3 to) {
    struct camera c = {.width = WIDTH, .height = HEIGHT, .fx = 30, .fy = 30, .cx = WIDTH / 2.0f,
                       .cy = HEIGHT / 2.0f};
    vec3 z = vec3_normalize(vec3_sub(to, from));
    vec3 x = vec3_normalize(vec3_cross(z, (vec3){0.01f, 1.0f, 0.02f}));
    vec3 y = vec3_cross(z, x);
    struct rigid w = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}, from};
    c.world_from_camera = w;
    c.camera_from_world = rigid_inverse(&w);
    return c;
}

static vec3 spread(int i, float margin) {
    float a = fmodf((float)i * 0.618f, 1.0f), b = fmodf((float)i * 0.755f, 1.0f);
    float c = fmodf((float)i * 0.570f, 1.0f);
    return (vec3){margin + a * (4 - 2 * margin), margin + b * (2.6f - 2 * margin),
                  margin + c * (3 - 2 * margin)};
}

/* The truth, seen by FRAMES cameras, every fifth of them held out. */
static void make_scene(struct scene *scene, struct parallel *pool) {
    *scene = (struct scene){0};
    make_mesh(&scene->mesh);
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials truth;
    struct world world;
    struct error err = {0};
    segments_from_object_id(&segments, &scene->mesh);
    CHECK(atlas_make(&atlas, &scene->mesh, &segments, 128, 0.0f, &err) == STATUS_OK);
    inverse_uv_make(&inverse, &atlas, scene->mesh.triangle_count, pool);
    materials_init(&truth, &inverse, OBJECTS, rgb_gray(0.5f), 1.0f, 0.0f);
    for (size_t i = 0; i < inverse.valid_count; i++) {
        uint32_t texel = inverse.valid[i];
        rgb color = wall_color[segments.of_triangle[inverse.triangle[texel]]];
        memcpy(truth.base_color.texel[texel], &color, sizeof color);
    }
    truth.emission[LAMP] = lamp_radiance;
    CHECK(world_init(&world, &scene->mesh, &segments, &atlas, &truth, NULL, pool, &err) == STATUS_OK);
    struct path_settings path = {.max_depth = 8, .roulette_depth = 5, .seed = 99};
    scene->photograph = mem_calloc(FRAMES, sizeof *scene->photograph);
    scene->photograph_count = FRAMES;
    for (int f = 0; f < FRAMES; f++) {
        struct photograph *photo = &scene->photograph[f];
        *photo = (struct photograph){.is_hdr = true, .exposure_known = true, .exposure = 1.0f,
                                     .gain = {1, 1, 1}, .clip = INFINITY, .is_test = f % 5 == 4};
        photo->name = mem_printf("frame %d", f);
        photo->camera = look(spread(f, 0.4f), spread(f * 7 + 3, 0.0f));
        struct image image;
        film_render(&world, &photo->camera, 64, &path, (uint32_t)f, pool, &image);
        photo->pixel = mem_array(WIDTH * HEIGHT, sizeof *photo->pixel);
        for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
            for (size_t c = 0; c < 3; c++)
                photo->pixel[i][c] = image_half_from_float(image.pixel[image.channel_count * i + c]);
        }
        image_release(&image);
    }
    world_release(&world);
    materials_release(&truth);
    inverse_uv_release(&inverse);
    atlas_release(&atlas);
    segments_release(&segments);
}

/* The surroundings: a checkpoint in memory, and a stop after some iterations. */
struct shell {
    long polls_until_stop; /* negative: never */
    unsigned char *saved[32];
    size_t saved_count;
    bool has_checkpoint;
};

static bool stop_requested(void *user) {
    struct shell *s = user;
    return s->polls_until_stop >= 0 && s->polls_until_stop-- == 0;
}
static void ignore_stage(void *user, const char *stage) { (void)user, (void)stage; }
static void ignore_progress(void *user, const char *stage, double done, double total, double eta) {
    (void)user, (void)stage, (void)done, (void)total, (void)eta;
}
static void ignore_metric(void *user, const char *series, long step, double value) {
    (void)user, (void)series, (void)step, (void)value;
}
static void ignore_log(void *user, const char *message) { (void)user, (void)message; }
static bool never(void *user) {
    (void)user;
    return false;
}
static enum status save(void *user, long iteration, const struct state_array *array, size_t count,
                        struct error *err) {
    struct shell *s = user;
    (void)iteration, (void)err;
    for (size_t i = 0; i < count; i++) {
        if (!s->has_checkpoint)
            s->saved[i] = mem_alloc(array[i].bytes);
        memcpy(s->saved[i], array[i].data, array[i].bytes);
    }
    s->saved_count = count;
    s->has_checkpoint = true;
    return STATUS_OK;
}
static enum status load(void *user, struct state_array *array, size_t count, bool *found,
                        struct error *err) {
    struct shell *s = user;
    (void)err;
    *found = s->has_checkpoint;
    for (size_t i = 0; *found && i < count; i++)
        memcpy(array[i].data, s->saved[i], array[i].bytes);
    return STATUS_OK;
}
static enum status no_preview(void *user, const struct reconstruction *r, struct error *err) {
    (void)user, (void)r, (void)err;
    return STATUS_OK;
}

static enum status run(struct scene *scene, const struct settings *settings, int threads,
                       struct shell *shell, struct reconstruction *r) {
    struct reconstruct_hooks hooks = {shell, stop_requested, ignore_stage, ignore_progress,
                                      ignore_metric, ignore_log, never, never, save, load,
                                      no_preview};
    struct parallel *pool = parallel_new(threads);
    struct error err = {0};
    enum status status = reconstruct_run(scene, settings, pool, &hooks, r, &err);
    if (status != STATUS_OK && status != STATUS_CANCELLED)
        fprintf(stderr, "%s\n", err.message);
    parallel_free(pool);
    r->pool = NULL;
    return status;
}

static void shell_release(struct shell *s) {
    for (size_t i = 0; i < s->saved_count; i++)
        mem_free(s->saved[i]);
}

static void digest(const struct reconstruction *r, char hex[SHA256_HEX_SIZE]) {
    const struct materials *m = &r->materials;
    struct sha256 sha;
    sha256_init(&sha);
    size_t texels = (size_t)m->base_color.width * m->base_color.height;
    sha256_update(&sha, m->base_color.texel, texels * sizeof *m->base_color.texel);
    sha256_update(&sha, m->roughness, m->segment_count * sizeof *m->roughness);
    sha256_update(&sha, m->specular, m->segment_count * sizeof *m->specular);
    sha256_update(&sha, m->emission, m->segment_count * sizeof *m->emission);
    sha256_hex(&sha, hex);
}

static struct settings make_settings(const char *json) {
    struct settings s;
    struct error err = {0};
    cJSON *object = NULL;
    settings_init(&s);
    CHECK(json_parse(json, strlen(json), "settings", &object, &err) == STATUS_OK);
    CHECK_THAT(settings_apply(&s, object, NULL, &err) == STATUS_OK, "%s", err.message);
    cJSON_Delete(object);
    return s;
}

static void test_same_bytes(struct scene *scene, const char *json) {
    struct settings s = make_settings(json);
    char first[SHA256_HEX_SIZE], hex[SHA256_HEX_SIZE];
    const int threads[] = {1, 2, 3, 7};
    for (int i = 0; i < 4; i++) {
        struct shell shell = {.polls_until_stop = -1};
        struct reconstruction r;
        CHECK(run(scene, &s, threads[i], &shell, &r) == STATUS_OK);
        digest(&r, i == 0 ? first : hex);
        if (i > 0)
            CHECK_STRING(hex, first);
        reconstruct_release(&r);
        shell_release(&shell);
    }
    /* Stopped every few iterations, at every level and on both sides of the emitter decision. */
    struct shell shell = {.polls_until_stop = 3};
    enum status status = STATUS_CANCELLED;
    int stops = 0;
    for (; status == STATUS_CANCELLED && stops < 60; stops++) {
        struct reconstruction r;
        shell.polls_until_stop = 3 + stops % 9; /* the stages after the loop ask too */
        status = run(scene, &s, 1 + stops % 3, &shell, &r);
        if (status == STATUS_OK)
            digest(&r, hex);
        reconstruct_release(&r);
    }
    CHECK(status == STATUS_OK);
    CHECK_THAT(stops > 8, "only %d stops", stops);
    CHECK_STRING(hex, first);
    shell_release(&shell);
    settings_release(&s);
}

static void test_recovers(struct scene *scene) {
    struct settings s = make_settings("{\"texture_size\":64,\"iterations\":700,\"report_samples\":32,"
                                      "\"texels_per_iteration\":512}");
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(run(scene, &s, 0, &shell, &r) == STATUS_OK);
    double error[OBJECTS] = {0}, bias[OBJECTS] = {0}, count[OBJECTS] = {0};
    for (size_t i = 0; i < r.inverse.valid_count; i++) {
        uint32_t texel = r.inverse.valid[i];
        if (r.observed.count[texel] < 2.0f)
            continue;
        uint32_t segment = r.segments.of_triangle[r.inverse.triangle[texel]];
        const float *t = r.materials.base_color.texel[texel];
        const rgb *c = &wall_color[segment];
        error[segment] += pow((double)(t[0] - c->r), 2) + pow((double)(t[1] - c->g), 2) +
                          pow((double)(t[2] - c->b), 2);
        bias[segment] += (double)(t[0] - c->r + t[1] - c->g + t[2] - c->b);
        count[segment] += 3.0;
    }
    for (int o = 0; o < OBJECTS; o++) {
        double rms = sqrt(error[o] / count[o]);
        const rgb *e = &r.materials.emission[o];
        printf("object %d: base colour off by %.4f, mean %+.4f, roughness %.3f, specular %.3f, emission %.4g %.4g %.4g\n",
               o, rms, bias[o] / count[o], (double)r.materials.roughness[o], (double)r.materials.specular[o], (double)e->r,
               (double)e->g, (double)e->b);
        if (o == LAMP) {
            CHECK_NEAR(e->r, lamp_radiance.r, 0.05f * lamp_radiance.r);
            CHECK_NEAR(e->g, lamp_radiance.g, 0.05f * lamp_radiance.g);
            CHECK_NEAR(e->b, lamp_radiance.b, 0.05f * lamp_radiance.b);
        } else {
            CHECK_THAT(rms < 0.09 && fabs(bias[o] / count[o]) < 0.06, "object %d: %.4f", o, rms);
            CHECK(rgb_is_black(*e));
        }
    }
    double msre = 0.0;
    for (size_t i = 0; i < r.held_out_count; i++)
        msre += r.held_out[i].msre / (double)r.held_out_count;
    printf("held-out MSRE %.4f\n", msre);
    CHECK(r.held_out_count == FRAMES / 5);
    CHECK_THAT(msre < 0.045, "held-out MSRE %.4f", msre);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
}

int main(void) {
    struct scene scene;
    struct parallel *pool = parallel_new(0);
    make_scene(&scene, pool);
    parallel_free(pool);
    test_same_bytes(&scene, "{\"texture_size\":64,\"iterations\":40,\"report_samples\":2,"
                            "\"texels_per_iteration\":256,\"coarse_levels\":3}");
    test_same_bytes(&scene, "{\"texture_size\":64,\"iterations\":40,\"report_samples\":2,\"guided\":false,"
                            "\"texels_per_iteration\":256,\"coarse_levels\":3}");
    test_recovers(&scene);
    scene_release(&scene);
    return check_result();
}
