/* open_room.h -- the small room with a window, lit by a sky: for tests of what comes from outside. Owns the room, its
 * photographs and the sky; reconstructs nothing. */
#ifndef UNBAKE_TESTS_RENDER_OPEN_ROOM_H
#define UNBAKE_TESTS_RENDER_OPEN_ROOM_H

#include "server/capture/views.h"
#include "server/scene/latlong.h"
#include "tests/render/small_room.h"

#define SKY_WIDTH 256

/* Blue above, brown below, a sun of some degrees in view of the window (which looks along -z). */
static inline rgb sky_at(vec3 d) {
    vec3 sun = vec3_normalize((vec3){-0.1f, 0.25f, -1.0f});
    if (vec3_dot(d, sun) > 0.992f)
        return (rgb){120.0f, 110.0f, 90.0f};
    float up = 0.5f + 0.5f * d.y;
    return d.y > 0.0f ? (rgb){6.0f - 3.0f * up, 7.0f - 2.0f * up, 8.0f + 2.0f * d.x}
                      : (rgb){2.0f, 1.5f + 0.5f * d.x, 1.0f};
}

static inline vec3 direction_of(const struct image *map, uint32_t x, uint32_t y) {
    return latlong_pixel(map->width, map->height, x, y);
}

static inline void make_sky(struct image *sky) {
    image_init_rgb(sky, SKY_WIDTH, SKY_WIDTH / 2);
    for (uint32_t i = 0; i < sky->width * sky->height; i++) {
        rgb value = sky_at(direction_of(sky, i % sky->width, i / sky->width));
        memcpy(sky->pixel + 3 * i, &value, sizeof value);
    }
}

/* The small room with a window of `width` x 1.4 m in the wall at z = 0. */
static inline void make_open_mesh(struct mesh *m, float width) {
    make_mesh(m);
    m->position = mem_realloc_array(m->position, 4 * (OBJECTS + 3), sizeof *m->position);
    m->index = mem_realloc_array(m->index, 2 * (OBJECTS + 3), sizeof *m->index);
    m->face = mem_realloc_array(m->face, 2 * (OBJECTS + 3), sizeof *m->face);
    m->object_id = mem_realloc_array(m->object_id, 2 * (OBJECTS + 3), sizeof *m->object_id);
    /* What was the wall becomes the part below the window. */
    float left = 2.0f - 0.5f * width, right = 2.0f + 0.5f * width;
    m->position[4 * 4 + 2].y = m->position[4 * 4 + 3].y = 0.8f;
    add_quad(m, 4, (vec3){0, 2.2f, 0}, (vec3){4, 0, 0}, (vec3){0, 0.8f, 0});
    add_quad(m, 4, (vec3){0, 0.8f, 0}, (vec3){left, 0, 0}, (vec3){0, 1.4f, 0});
    add_quad(m, 4, (vec3){right, 0.8f, 0}, (vec3){4 - right, 0, 0}, (vec3){0, 1.4f, 0});
}

/* Every other camera looks through the window. */
static inline vec3 look_out_often(int frame) {
    vec3 anywhere = look_anywhere(frame);
    return frame % 2 ? anywhere : (vec3){0.8f + 0.6f * anywhere.x, 0.8f + 0.5f * anywhere.y, -0.5f};
}

/* What environment_gather needs of a scene. */
struct rig {
    struct scene *scene;
    struct segments segments;
    struct accel *accel;
    struct views views;
    struct parallel *pool;
};

static inline void rig_init(struct rig *r, struct scene *scene, int threads) {
    struct error err;
    r->scene = scene;
    r->pool = parallel_new(threads);
    segments_from_object_id(&r->segments, &scene->mesh);
    CHECK(accel_new(&r->accel, &scene->mesh, r->pool, &err) == STATUS_OK);
    views_init(&r->views, scene, &r->segments, r->accel, r->pool);
}

static inline void rig_release(struct rig *r) {
    views_release(&r->views);
    accel_free(r->accel);
    segments_release(&r->segments);
    parallel_free(r->pool);
}

/* The same scene with the pixels masked that look out, but for those that look down to below a height (-1: none). */
static inline void mask_open(struct scene *masked, struct scene *scene, float below) {
    struct rig rig;
    *masked = *scene;
    masked->photograph = mem_array(scene->photograph_count, sizeof *masked->photograph);
    memcpy(masked->photograph, scene->photograph, scene->photograph_count * sizeof *masked->photograph);
    rig_init(&rig, scene, 1);
    for (size_t t = 0; t < rig.views.train_count; t++) {
        struct photograph *photo = &masked->photograph[rig.views.train[t]];
        photo->mask = mem_array(WIDTH * HEIGHT, 1);
        for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
            vec3 direction = {0.0f, 1.0f, 0.0f};
            camera_direction(&photo->camera, (float)(i % WIDTH) + 0.5f, (float)(i / WIDTH) + 0.5f, &direction);
            photo->mask[i] = rig.views.shows[t][i] != VIEWS_OPEN || direction.y < below;
        }
    }
    rig_release(&rig);
}

static inline void forget_masked(struct scene *masked) {
    for (size_t i = 0; i < masked->photograph_count; i++) {
        mem_free(masked->photograph[i].mask);
        mem_free(masked->photograph[i].firefly); /* found in its own reconstruction */
    }
    mem_free(masked->photograph);
}

/* The room under that sky, which alone lights it, and the same with all masked that look out. */
struct open_room {
    struct parallel *pool;
    struct image sky;
    struct scene scene, masked;
};

static inline void open_room_init(struct open_room *room) {
    *room = (struct open_room){.pool = parallel_new(0)};
    make_sky(&room->sky);
    make_open_mesh(&room->scene.mesh, 2.4f);
    photograph_mesh(&room->scene, rgb_gray(0.0f), &room->sky, look_out_often, room->pool);
    mask_open(&room->masked, &room->scene, -1.0f);
}

static inline void open_room_release(struct open_room *room) {
    forget_masked(&room->masked);
    scene_release(&room->scene);
    image_release(&room->sky);
    parallel_free(room->pool);
}

#endif
