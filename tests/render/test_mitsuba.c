/* scene.xml as Mitsuba 3 renders it against our own renders: the demo room from inside, by its lamps,
 * and from outside, by distant light. Places, textures, materials, lamps, the environment's
 * orientation and the sensor must all be right for blocks of pixels to agree.
 *
 * Wants a Python that has Mitsuba: $UNBAKE_MITSUBA_PYTHON, or the one that `make bench` makes. */
#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/demo/room.h"
#include "server/export/outputs.h"
#include "server/render/film.h"
#include "tests/check.h"

#define WIDTH 64
#define HEIGHT 48
#define BLOCK 8 /* pixels a side */
#define SPP 64
#define MAX_DEPTH 16 /* as in scene.xml */

enum { INSIDE, OUTSIDE, VIEWS };

static const char *find_python(void) {
    const char *given = getenv("UNBAKE_MITSUBA_PYTHON");
    if (given)
        return given;
    return access("build/mitsuba/bin/python", X_OK) == 0 ? "build/mitsuba/bin/python" : NULL;
}

/* Off centre, so that the principal point counts. */
static struct camera look(vec3 from, vec3 at) {
    struct camera c = {
        .width = WIDTH, .height = HEIGHT, .fx = 45.0f, .fy = 45.0f, .cx = 0.42f * WIDTH, .cy = 0.56f * HEIGHT};
    vec3 forward = vec3_normalize(vec3_sub(at, from));
    vec3 right = vec3_normalize(vec3_cross(forward, (vec3){0.0f, 1.0f, 0.0f}));
    vec3 down = vec3_cross(forward, right);
    c.world_from_camera = (struct rigid){
        {{right.x, down.x, forward.x}, {right.y, down.y, forward.y}, {right.z, down.z, forward.z}}, from};
    c.camera_from_world = rigid_inverse(&c.world_from_camera);
    return c;
}

/* A sky whose every quarter has a colour of its own. */
static void make_sky(struct image *sky, struct image *known) {
    static const char *const known_names[] = {"count", "spread"};
    image_init_rgb(sky, 32, 16);
    image_init(known, 32, 16, 2, known_names);
    for (uint32_t y = 0; y < 16; y++) {
        for (uint32_t x = 0; x < 32; x++) {
            float *p = sky->pixel + 3 * (32 * y + x);
            float turn = 6.2831853f * ((float)x + 0.5f) / 32.0f, up = 1.0f - (float)y / 15.0f;
            p[0] = 0.3f + 0.25f * sinf(turn) + up;
            p[1] = 0.3f + 0.25f * cosf(turn) + up;
            p[2] = 0.2f + 0.15f * sinf(2.0f * turn) + 2.0f * up;
        }
    }
}

/* Mean of the block's channels. */
static rgb block_mean(const struct image *image, uint32_t bx, uint32_t by) {
    rgb sum = {0.0f, 0.0f, 0.0f};
    for (uint32_t y = by * BLOCK; y < (by + 1) * BLOCK; y++) {
        for (uint32_t x = bx * BLOCK; x < (bx + 1) * BLOCK; x++) {
            const float *p = image->pixel + ((size_t)y * image->width + x) * image->channel_count;
            sum = rgb_add(sum, (rgb){p[0], p[1], p[2]});
        }
    }
    return rgb_scale(sum, 1.0f / (BLOCK * BLOCK));
}

static void compare(const char *dir, int view, const struct image *ours, const char *python) {
    struct image theirs;
    struct error err;
    char *out = mem_printf("%s/mitsuba-%d.exr", dir, view);
    char *command = mem_printf("'%s' tests/render/mitsuba_view.py %s %d %d %s", python, dir, view, SPP, out);
    int exit_status = system(command);
    CHECK_THAT(exit_status == 0, "%s: %d", command, exit_status);
    enum status status = image_read(out, &theirs, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    if (status == STATUS_OK && theirs.width == WIDTH && theirs.height == HEIGHT) {
        double sum = 0.0, difference = 0.0;
        for (uint32_t b = 0; b < (WIDTH / BLOCK) * (HEIGHT / BLOCK); b++) {
            rgb a = block_mean(ours, b % (WIDTH / BLOCK), b / (WIDTH / BLOCK));
            rgb d = rgb_sub(block_mean(&theirs, b % (WIDTH / BLOCK), b / (WIDTH / BLOCK)), a);
            sum += (double)rgb_mean(a);
            difference += (double)rgb_mean((rgb){fabsf(d.r), fabsf(d.g), fabsf(d.b)});
        }
        printf("view %d: blocks differ by %.2f %%\n", view, 100.0 * difference / sum);
        CHECK_THAT(difference < 0.03 * sum, "view %d: %.3f", view, difference / sum);
    }
    image_release(&theirs);
    mem_free(command);
    mem_free(out);
}

/* Exports the room, renders it from both places with either renderer, and compares. */
static void try(struct room *room, const struct image *sky, const struct image *known, const char *python,
                struct parallel *pool) {
    char dir[] = "/tmp/unbake-mitsuba-XXXXXX";
    const struct camera camera[VIEWS] = {
        look((vec3){0.8f, 1.5f, 3.4f}, (vec3){3.5f, 1.1f, 1.0f}),
        look((vec3){9.0f, 5.0f, 8.0f}, (vec3){3.5f, 1.6f, 2.0f}),
    };
    struct path_settings settings = {.max_depth = MAX_DEPTH, .roulette_depth = 5, .seed = 3};
    struct image picture[VIEWS];
    struct export_comparison comparison[VIEWS];
    struct error err;
    CHECK(mkdtemp(dir) != NULL);
    for (int v = 0; v < VIEWS; v++) {
        film_render(&room->world, &camera[v], SPP, &settings, (uint32_t)v, pool, &picture[v]);
        comparison[v] = (struct export_comparison){"view.exr", &picture[v], &picture[v], &camera[v]};
    }
    size_t texels = (size_t)room->atlas.width * room->atlas.height;
    float *zero = mem_calloc(texels, sizeof *zero);
    bool is_emitter[ROOM_OBJECT_COUNT] = {false};
    cJSON *report = cJSON_CreateObject();
    struct export_input in = {.title = "room",
                              .mesh = &room->mesh,
                              .segments = &room->segments,
                              .atlas = &room->atlas,
                              .inverse = &room->inverse,
                              .materials = &room->materials,
                              .observation_count = zero,
                              .is_emitter = is_emitter,
                              .environment = sky,
                              .environment_confidence = known,
                              .comparison_count = VIEWS,
                              .comparison = comparison,
                              .has_materials = true,
                              .report = report};
    enum status status = export_outputs(dir, &in, NULL, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    for (int v = 0; v < VIEWS && status == STATUS_OK; v++)
        compare(dir, v, &picture[v], python);
    cJSON_Delete(report);
    mem_free(zero);
    for (int v = 0; v < VIEWS; v++)
        image_release(&picture[v]);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
}

int main(void) {
    const char *python = find_python();
    if (!python)
        CHECK_SKIP("no Python with Mitsuba 3: `make bench` makes one");
    struct parallel *pool = parallel_new(0);
    struct room room;
    struct error err;
    struct image sky, known;
    CHECK(room_init(&room, &(struct room_look){512, 15.0f, 15.0f, ROOM_LAMPS_FRAMED}, pool, &err) == STATUS_OK);
    room.materials.specular[ROOM_CARPET] = 0.0f;
    make_sky(&sky, &known);
    world_set_environment(&room.world, &sky, pool);
    try(&room, &sky, &known, python, pool);

    /* Once more without shading normals. */
    world_release(&room.world);
    mem_free(room.mesh.normal);
    room.mesh.normal = NULL;
    CHECK(world_init(&room.world, &room.mesh, &room.segments, &room.atlas, &room.materials, &sky, pool, &err) ==
          STATUS_OK);
    try(&room, &sky, &known, python, pool);
    image_release(&sky);
    image_release(&known);
    room_release(&room);
    parallel_free(pool);
    return check_result();
}
