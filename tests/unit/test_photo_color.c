/* test_photo_color.c -- photographs of Display P3 in a bundle: converted and said to be, saturated where the file is
 * and nowhere else, masks left alone; and profiles that cannot be used are said once. */
#include "common/file.h"
#include "common/image.h"
#include "server/ingest/bundle.h"
#include "server/ingest/facts.h"
#include "tests/unit/profiles.h"

static struct error err;
static char dir[] = "/tmp/unbake-test-photo-color-XXXXXX";

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)
#define FRAME(name, more)                                                                                              \
    "{\"file_path\":\"" name ".png\"" more ",\"transform_matrix\":[[1,0,0,0.3],[0,1,0,0.3],[0,0,1,1]]}"
#define MESH "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"

static void put(const char *name, const void *data, size_t length) {
    char *path = file_join(dir, name);
    OK(file_replace(path, data, length, &err));
    mem_free(path);
}

/* Of red only the first is saturated; the second passes the clip in Rec. 709, being redder than that can show. */
static const uint16_t pixels[4][3] = {{255, 200, 100}, {242, 20, 20}, {100, 100, 100}, {10, 250, 10}};

static void put_photograph(const char *name, const struct buf *profile) {
    struct buf file;
    png_begin(&file, 4, 8, 2);
    if (profile)
        png_iccp(&file, profile);
    png_end(&file, &pixels[0][0], 12, 8);
    put(name, file.data, file.length);
    buf_release(&file);
}

/* Black and nearly black: all that is not 0 is used. */
static void put_mask(const struct buf *profile) {
    struct buf file;
    png_begin(&file, 4, 8, 2);
    png_iccp(&file, profile);
    png_end(&file, (const uint16_t[]){0, 0, 0, 1, 1, 1, 255, 255, 255, 0, 0, 0}, 12, 8);
    put("m.png", file.data, file.length);
    buf_release(&file);
}

static void load(struct scene *scene) {
    struct bundle_limits limits = bundle_default_limits();
    struct parallel *pool = parallel_new(1);
    cJSON *problems = cJSON_CreateArray();
    OK(bundle_load(dir, NULL, &limits, pool, scene, problems, &err));
    cJSON_Delete(problems);
    parallel_free(pool);
}

static size_t warnings_with(const struct scene *scene, const char *part) {
    size_t count = 0;
    for (size_t i = 0; i < scene->warning_count; i++)
        count += strstr(scene->warning[i], part) != NULL;
    return count;
}

static void check_fact(const struct scene *scene, const char *wanted) {
    cJSON *facts = facts_of(scene);
    const char *found = cJSON_GetStringValue(cJSON_GetObjectItem(facts, "photographs"));
    CHECK_STRING(found ? found : "nothing", wanted);
    cJSON_Delete(facts);
}

static float value_of(const struct photograph *photo, size_t at, int channel) {
    return image_float_from_half(photo->pixel[at][channel]);
}

static void check_photograph(const struct photograph *photo) {
    struct photograph_sample sample;
    CHECK(photo->camera.width == 4 && !photo->is_hdr && !photo->exposure_known);
    CHECK_STRING(photo->color_space, "Display P3");
    CHECK_NEAR(photo->clip, image_srgb_to_linear(250 / 255.0f), 1e-3);
    CHECK(photograph_sample(photo, 0.5f, 0.5f, &sample));
    CHECK(sample.saturated[0] && !sample.saturated[1] && !sample.saturated[2] && sample.radiance.r > 1.0f);
    CHECK(value_of(photo, 1, 0) > photo->clip && value_of(photo, 1, 1) == 0.0f); /* what is negative is 0 */
    CHECK(photograph_sample(photo, 1.5f, 0.5f, &sample));
    CHECK(!sample.saturated[0] && !sample.saturated[1]);
    CHECK(photograph_sample(photo, 2.5f, 0.5f, &sample) && !sample.saturated[0]);
    CHECK_NEAR(sample.radiance.g, image_srgb_to_linear(100 / 255.0f), 1e-3);
    CHECK(photograph_sample(photo, 3.5f, 0.5f, &sample));
    CHECK(!sample.saturated[0] && sample.saturated[1]);
}

int main(void) {
    struct scene scene;
    struct buf p3;
    CHECK(mkdtemp(dir) != NULL);
    profile_display_p3(&p3);
    put("room.obj", MESH, sizeof MESH - 1);
    static const char transforms[] =
        "{\"fl_x\":4,\"frames\":[" FRAME("a", ",\"mask_path\":\"m.png\"") "," FRAME("b", "") "," FRAME("c", "") "]}";
    put("transforms.json", transforms, sizeof transforms - 1);
    put_photograph("a.png", &p3);
    put_photograph("b.png", &p3);
    put_photograph("c.png", NULL);
    put_mask(&p3);
    load(&scene);
    check_fact(&scene, "Display P3, converted to Rec. 709 (2 of 3)");
    CHECK(scene.photograph_count == 3);
    check_photograph(&scene.photograph[1]);
    CHECK(!scene.photograph[2].clipped && !scene.photograph[2].color_space);
    const uint8_t *mask = scene.photograph[0].mask;
    CHECK(mask && mask[0] == 0 && mask[1] != 0 && mask[2] != 0 && mask[3] == 0);
    CHECK(warnings_with(&scene, "50.0 % of the pixels of 2 photographs") == 1);
    scene_release(&scene);

    memcpy(p3.data + 36, "none", 4); /* no profile */
    put_photograph("a.png", &p3);
    put_photograph("b.png", &p3);
    load(&scene);
    check_fact(&scene, "nothing");
    CHECK(warnings_with(&scene, "a.png: its ICC profile is damaged") == 1);
    CHECK(warnings_with(&scene, "taken for those of sRGB (so are those of 1 others)") == 1 && scene.warning_count == 1);
    scene_release(&scene);
    buf_release(&p3);
    char *remove = mem_printf("rm -rf '%s'", dir);
    CHECK(system(remove) == 0);
    mem_free(remove);
    return check_result();
}
