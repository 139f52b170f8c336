/* grey_card.h, unseen_light.h: in a room whose light comes from a sky that no photograph shows, the scale of base
 * colours is a guess. A pixel of known reflectance fixes it; where the sky is seen, it only says how well base colour
 * came out. */
#include "server/capture/grey_card.h"
#include "tests/render/open_room.h"
#include "tests/render/shell.h"

#define SETTINGS                                                                                                       \
    "{\"texture_size\":64,\"iterations\":1,\"report_samples\":1,\"gather_samples\":128,\"grey_card\":\"%s,%g\"}"

/* A pixel that shows a wall, and what that reflects. */
static double find_wall(const struct scene *scene, char *card, size_t size) {
    struct accel *accel;
    struct accel_hit hit;
    vec3 direction;
    double reflectance = 0.0;
    struct parallel *pool = parallel_new(1);
    CHECK(accel_new(&accel, &scene->mesh, pool, NULL) == STATUS_OK);
    for (size_t i = 0; i < scene->photograph_count && reflectance == 0.0; i++) {
        const struct camera *c = &scene->photograph[i].camera;
        if (scene->photograph[i].is_test || !camera_direction(c, WIDTH / 2 + 0.5f, HEIGHT / 2 + 0.5f, &direction) ||
            !accel_intersect(accel, camera_origin(c), direction, 0.0f, INFINITY, &hit) ||
            scene->mesh.object_id[hit.triangle] != 0) /* the floor */
            continue;
        rgb color = wall_color[scene->mesh.object_id[hit.triangle]];
        reflectance = ((double)color.r + (double)color.g + (double)color.b) / 3.0;
        snprintf(card, size, "%s,%d,%d", scene->photograph[i].name, WIDTH / 2, HEIGHT / 2);
    }
    CHECK(reflectance > 0.0);
    accel_free(accel);
    parallel_free(pool);
    return reflectance;
}

/* The card of a report; the ratio of base colour there to its reflectance. */
static double run(struct scene *scene, const char *card, double reflectance, double *factor, char *warned,
                  size_t size) {
    char json[512];
    snprintf(json, sizeof json, SETTINGS, card, reflectance);
    struct settings s = shell_settings(json);
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 0, &shell, &r) == STATUS_OK);
    const cJSON *report = cJSON_GetObjectItem(r.report, "grey_card");
    const cJSON *scaled = cJSON_GetObjectItem(report, "unseen_light_scaled_by");
    double ratio = cJSON_GetNumberValue(cJSON_GetObjectItem(report, "ratio"));
    *factor = scaled ? cJSON_GetNumberValue(scaled) : 0.0;
    snprintf(warned, size, "%s", shell.warned);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    return ratio;
}

static void check_faults(const struct scene *scene) {
    static const struct {
        struct pixel_setting pixel;
        const char *part;
    } faults[] = {
        {{"nowhere.png", 1, 1, 0.2}, "no photograph nowhere.png"},
        {{"", WIDTH, 1, 0.2}, "pixels, none at"},
        {{"", 1, HEIGHT, 0.2}, "pixels, none at"},
        {{"", 0, 0, 0.2}, "shows nothing of the mesh"},
    };
    struct error err;
    struct accel *accel;
    struct mesh away = {0};
    vec3 corner[3] = {{100, 100, 100}, {101, 100, 100}, {100, 101, 100}};
    uint32_t index[1][3] = {{0, 1, 2}};
    struct parallel *pool = parallel_new(1);
    away.position = corner;
    away.vertex_count = 3;
    away.index = index;
    away.triangle_count = 1;
    CHECK(accel_new(&accel, &away, pool, NULL) == STATUS_OK);
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        struct pixel_setting pixel = faults[i].pixel;
        struct grey_card card;
        if (!*pixel.photograph)
            snprintf(pixel.photograph, sizeof pixel.photograph, "%s", scene->photograph[0].name);
        CHECK(grey_card_find(&card, &pixel, scene, &(struct surface){0}, accel, &err) == STATUS_INPUT);
        CHECK_THAT(strstr(err.message, faults[i].part), "%s", err.message);
    }
    accel_free(accel);
    parallel_free(pool);
}

int main(void) {
    struct open_room room;
    char card[128], warned[512];
    double factor;
    open_room_init(&room);
    double truth = find_wall(&room.scene, card, sizeof card);
    check_faults(&room.scene);

    /* Where the sky is seen, a wrong card changes nothing and is told. */
    double ratio = run(&room.scene, card, 0.5 * truth, &factor, warned, sizeof warned);
    printf("sky seen: %.3f of a card that is half of the truth\n", ratio);
    CHECK(factor == 0.0);
    CHECK_NEAR(ratio, 2.0, 0.3);
    CHECK_THAT(strstr(warned, "grey card: base colour"), "%s", warned);

    /* Where it is not, base colour is what the card says. */
    room.masked.mesh = room.scene.mesh; /* which has normals by now */
    ratio = run(&room.masked, card, 0.5 * truth, &factor, warned, sizeof warned);
    printf("sky unseen: %.3f of it, light scaled by %.3f\n", ratio, factor);
    CHECK(factor > 1.5);
    CHECK_NEAR(ratio, 1.0, 0.1);
    open_room_release(&room);
    return check_result();
}
