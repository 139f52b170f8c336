/* test_bundle_rooms.c -- the real rooms: poses, axes, pixel places and objects against a renderer's pictures of
 * them. */
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/facts.h"
#include "tests/check.h"

static struct parallel *pool;

static const float *truth_pixel(const struct image *truth, float x, float y) {
    return truth->pixel + ((size_t)y * truth->width + (size_t)x) * truth->channel_count;
}

/* Whether the pixel and its eight neighbours show one object. */
static bool is_inside(const struct image *truth, float x, float y, size_t id) {
    if (x < 1.0f || y < 1.0f || x >= (float)truth->width - 1.0f || y >= (float)truth->height - 1.0f)
        return false;
    for (int k = 0; k < 9; k++)
        if (truth_pixel(truth, x + (float)(k % 3 - 1), y + (float)(k / 3 - 1))[id] != truth_pixel(truth, x, y)[id])
            return false;
    return true;
}

/* Poses, axes, pixel places and object_id against a renderer's pictures of the same room: where
 * a triangle's centre has the depth that the renderer saw, its object must be the one it saw. */
static void check_truth(const char *dir, const struct scene *scene) {
    size_t seen = 0, agreeing = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *photo = &scene->photograph[i];
        if (!photo->is_test)
            continue;
        char *path = mem_printf("%s/truth/%.3s.exr", dir, strrchr(photo->name, '/') + 1);
        struct image truth;
        enum status status = image_read(path, &truth, NULL, NULL);
        mem_free(path);
        CHECK(status == STATUS_OK);
        if (status != STATUS_OK)
            continue;
        size_t depth = (size_t)image_channel(&truth, "depth"), id = (size_t)image_channel(&truth, "object_id");
        for (size_t t = 0; t < scene->mesh.triangle_count; t++) {
            const uint32_t *v = scene->mesh.index[t];
            const vec3 *p = scene->mesh.position;
            vec3 centre = vec3_scale(vec3_add(p[v[0]], vec3_add(p[v[1]], p[v[2]])), 1.0f / 3.0f);
            float x, y, depth_m;
            if (!camera_project(&photo->camera, centre, &x, &y, &depth_m))
                continue;
            const float *pixel = truth_pixel(&truth, x, y);
            float distance_m = vec3_length(vec3_sub(centre, camera_origin(&photo->camera)));
            if (fabsf(pixel[depth] - distance_m) > 0.002f * distance_m || !is_inside(&truth, x, y, id))
                continue;
            seen++;
            agreeing += (int64_t)pixel[id] == scene->mesh.object_id[t];
        }
        image_release(&truth);
    }
    printf("%zu triangle centres seen, %zu with the right object\n", seen, agreeing);
    /* Towels and the like have layers closer than the 0.2 % of depth that is told apart. */
    CHECK(seen > 500 && (double)agreeing > 0.9 * (double)seen);
}

static void test_real(const char *root, const char *room, const char *transforms, size_t frames, size_t triangles) {
    char *dir = mem_printf("%s/%s", root, room);
    if (access(dir, R_OK) != 0) {
        printf("%s is not here\n", dir);
        mem_free(dir);
        return;
    }
    struct scene scene;
    struct error err = {.message = ""};
    struct bundle_limits limits = bundle_default_limits();
    cJSON *problems = cJSON_CreateArray();
    struct reading reading = reading_default();
    reading.transforms = (char *)transforms;
    enum status status = bundle_load(dir, &reading, &limits, pool, &scene, problems, &err);
    CHECK_THAT(status == STATUS_OK, "%s: %s", room, err.message);
    if (status == STATUS_OK) {
        cJSON *facts = facts_of(&scene);
        char *text = json_text(facts);
        printf("%s %s: %s\n", room, transforms ? transforms : "", text);
        CHECK(scene.photograph_count >= frames && scene.mesh.triangle_count >= triangles);
        mem_free(text);
        cJSON_Delete(facts);
        if (strncmp(room, "rooms/", 6) == 0)
            check_truth(dir, &scene);
    }
    scene_release(&scene);
    cJSON_Delete(problems);
    mem_free(dir);
}

int main(void) {
    const char *root = getenv("UNBAKE_TEST_DATA");
    pool = parallel_new(2);
    root = root ? root : "../shared/data";
    test_real(root, "rooms/staircase2", NULL, 80, 28000);
    test_real(root, "rooms/staircase2", "transforms_sdr.json", 80, 28000);
    test_real(root, "rooms/bathroom", NULL, 80, 360000);
    test_real(root, "redkitchen", NULL, 125, 290000);
    parallel_free(pool);
    return check_result();
}
