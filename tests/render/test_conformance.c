/* The path tracer and its derivatives against Mitsuba 3 on the conformance room: every picture by
 * z-tests per pixel and on the mean, with both sides' standard errors. In the long form (UNBAKE_LONG) of twice the
 * samples. */
#include "common/mem.h"
#include "common/rng.h"
#include "server/render/film.h"
#include "server/render/path.h"
#include "tests/render/room.h"

#define WIDTH 48
#define HEIGHT 36
#define PIXELS (WIDTH * HEIGHT)
#define GROUPS 24 /* independent estimates, from whose spread our error comes */
#define GROUPS_LONG 48
#define GROUP_SPP 16

enum { LEFT = 4, FLOOR = 0, TALL = 6, LAMP = 8, SHADE = 9, SEGMENTS = 10 };

enum picture {
    PRIMAL,
    BASE_LEFT,
    BASE_TALL,
    ROUGH_FLOOR,
    ROUGH_TALL,
    SPEC_FLOOR,
    SPEC_TALL,
    EMIT_LAMP,
    EMIT_SHADE,
    PICTURES
};

struct estimate {
    const struct room *room;
    const struct camera *camera;
    struct path_settings settings;
    bool derivatives;
    struct room_picture picture[PICTURES];
};

/* One group's derivatives of a pixel's channel by every parameter, out of its log. */
static void read_log(const struct gradient_log *log, int channel, double value[PICTURES][3]) {
    double base[SEGMENTS] = {0};
    for (size_t i = 0; i < log->entry_count; i++) {
        const struct gradient_entry *e = &log->entry[i];
        double d = (double)(channel == 0 ? e->d.r : channel == 1 ? e->d.g : e->d.b);
        for (uint32_t k = 0; k < 4; k++)
            if (e->weight[k] > 0.0f)
                base[room_segment_of_texel(e->x + k % 2, e->y + k / 2)] += (double)e->weight[k] * d;
    }
    value[BASE_LEFT][channel] = base[LEFT];
    value[BASE_TALL][channel] = base[TALL];
    value[ROUGH_FLOOR][channel] = log->segment[FLOOR].d_roughness;
    value[ROUGH_TALL][channel] = log->segment[TALL].d_roughness;
    value[SPEC_FLOOR][channel] = log->segment[FLOOR].d_specular;
    value[SPEC_TALL][channel] = log->segment[TALL].d_specular;
    value[EMIT_LAMP][channel] = log->segment[LAMP].d_emission[channel];
    value[EMIT_SHADE][channel] = log->segment[SHADE].d_emission[channel];
}

static void estimate_pixel(void *user, size_t pixel, int thread) {
    (void)thread;
    struct estimate *e = user;
    struct path_batch *batch = path_batch_new(GROUP_SPP, e->settings.max_depth);
    struct gradient_log *log = gradient_log_new(e->room->segments.count);
    struct ray ray[GROUP_SPP];
    struct path_key key[GROUP_SPP];
    rgb radiance[GROUP_SPP], adjoint[GROUP_SPP];
    int groups = e->picture[PRIMAL].estimates;
    for (int group = 0; group < groups; group++) {
        for (uint32_t i = 0; i < GROUP_SPP; i++) {
            key[i] = (struct path_key){(uint32_t)pixel, (uint32_t)group, i};
            uint64_t bits = rng_key(pixel, (uint64_t)group, i);
            float x = (float)(pixel % WIDTH) + rng_to_float((uint32_t)bits);
            float y = (float)(pixel / WIDTH) + rng_to_float((uint32_t)(bits >> 32));
            ray[i].origin = camera_origin(e->camera);
            CHECK(camera_direction(e->camera, x, y, &ray[i].direction));
        }
        path_batch_trace(batch, &e->room->world, &e->settings, GROUP_SPP, ray, key, radiance);
        double value[PICTURES][3] = {{0.0}};
        for (int i = 0; i < GROUP_SPP; i++) {
            value[PRIMAL][0] += (double)radiance[i].r;
            value[PRIMAL][1] += (double)radiance[i].g;
            value[PRIMAL][2] += (double)radiance[i].b;
        }
        for (int channel = 0; channel < 3 && e->derivatives; channel++) {
            for (int i = 0; i < GROUP_SPP; i++)
                adjoint[i] = (rgb){channel == 0, channel == 1, channel == 2};
            gradient_log_clear(log);
            path_batch_backward(batch, adjoint, log);
            read_log(log, channel, value);
        }
        for (int p = 0; p < PICTURES; p++) {
            for (int c = 0; c < 3; c++) {
                room_picture_add(&e->picture[p], pixel, c, value[p][c] / GROUP_SPP);
            }
        }
    }
    gradient_log_free(log);
    path_batch_free(batch);
}

static void compare(const struct estimate *e, enum picture p, const char *name) {
    char path[128];
    snprintf(path, sizeof path, "conformance/%s.exr", name);
    struct image wanted;
    room_read_image(path, &wanted);
    room_compare(&e->picture[p], &wanted, name);
    image_release(&wanted);
}

static void run(struct estimate *e) {
    for (int p = 0; p < PICTURES; p++)
        room_picture_init(&e->picture[p], WIDTH, HEIGHT, getenv("UNBAKE_LONG") ? GROUPS_LONG : GROUPS);
    parallel_for(e->room->pool, PIXELS, estimate_pixel, e);
}

static void finish(struct estimate *e) {
    for (int p = 0; p < PICTURES; p++)
        room_picture_release(&e->picture[p]);
}

int main(void) {
    struct room room;
    struct camera camera;
    room_load(&room, "conformance/room.ply", "conformance/room.json", "base_color", NULL, 0, NULL, 0);
    room_camera("conformance/room_transforms.json", "primal_all.exr", &camera);

    struct estimate direct = {
        .room = &room, .camera = &camera, .settings = {.max_depth = 2, .roulette_depth = 99, .seed = 11}};
    run(&direct);
    compare(&direct, PRIMAL, "primal_direct");
    finish(&direct);

    struct estimate all = {
        .room = &room, .camera = &camera, .settings = {.max_depth = 32, .roulette_depth = 6, .seed = 12}};
    run(&all);
    compare(&all, PRIMAL, "primal_all");
    finish(&all);

    struct estimate d = {.room = &room,
                         .camera = &camera,
                         .settings = {.max_depth = 9, .roulette_depth = 99, .seed = 13},
                         .derivatives = true};
    run(&d);
    compare(&d, BASE_LEFT, "d_base_color_left");
    compare(&d, BASE_TALL, "d_base_color_tall");
    compare(&d, ROUGH_FLOOR, "d_roughness_floor");
    compare(&d, ROUGH_TALL, "d_roughness_tall");
    compare(&d, EMIT_LAMP, "d_emission_lamp");
    compare(&d, EMIT_SHADE, "d_emission_shade");
    compare(&d, ROUGH_FLOOR, "fd_roughness_floor");
    compare(&d, ROUGH_TALL, "fd_roughness_tall");
    compare(&d, SPEC_FLOOR, "fd_specular_floor");
    compare(&d, SPEC_TALL, "fd_specular_tall");
    finish(&d);
    room_release(&room);

    struct image sky;
    room_read_image("hdri/lythwood_room_1k.hdr", &sky);
    room_load(&room, "conformance/room.ply", "conformance/room.json", "base_color", (int[]){1, 8}, 2, &sky, 0);
    struct estimate open = {
        .room = &room, .camera = &camera, .settings = {.max_depth = 32, .roulette_depth = 6, .seed = 14}};
    run(&open);
    compare(&open, PRIMAL, "primal_env");
    finish(&open);
    room_release(&room);
    image_release(&sky);
    return check_result();
}
