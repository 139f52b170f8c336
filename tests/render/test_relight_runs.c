/* Renders as runs (relight.h): lights by name, what is said of them, progress, and one that was stopped goes on. */
#include <sys/stat.h>

#include "common/file.h"
#include "common/sha256.h"
#include "tests/render/relight_rig.h"

/* Light adds up and scales; nothing that shines is told; what is not there is
 * told. */
static void test_lights(void) {
    char *dir = lit_room(CENTRE_VIEW);
    struct error err;
    struct image both, one;
    picture(dir, "{\"format\":\"exr\",\"spp\":16}", &both);
    picture(dir, "{\"format\":\"exr\",\"spp\":16,\"light.1\":\"2\",\"light.2\":\"2,2,2\"}", &one);
    CHECK_NEAR(relit_mean(&one) / relit_mean(&both), 2.0, 1e-3);
    image_release(&one);
    picture(dir, "{\"format\":\"exr\",\"spp\":16,\"lights\":\"off\",\"light.2\":\"on\"}", &one);
    CHECK(relit_mean(&one) > 0.0 && one.pixel[0] == 0.0f); /* no red in that lamp */
    image_release(&one);
    image_release(&both);
    CHECK(relit_picture(dir, "{\"lights\":\"off\",\"format\":\"exr\"}", pool, &one, &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "Nothing shines: the picture will be black.");
    CHECK(relit_picture(dir, "{\"light.9\":\"off\",\"format\":\"exr\"}", pool, &one, &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "setting light.9: the room has segments 0 to 5");
    CHECK(relit_picture(dir, "{\"remove\":\"door\",\"format\":\"exr\"}", pool, &one, &err) == STATUS_INPUT);
    CHECK(relit_picture(dir, "{\"denoise\":true,\"format\":\"exr\"}", pool, &one, &err) == STATUS_UNAVAILABLE);
    char *scene = file_join(dir, "scene.ply");
    CHECK(remove(scene) == 0);
    CHECK(relit_picture(dir, "{\"format\":\"exr\"}", pool, &one, &err) == STATUS_NOT_FOUND);
    CHECK_THAT(strstr(err.hint, "`unbake get`"), "%s; %s", err.message, err.hint);
    mem_free(scene);
    relit_remove(dir);
}

static void hear(void *user, const char *text) { snprintf(user, 128, "%s", text); }

/* A sky outside of a closed room: the picture is black, and that is said. */
static void test_closed(void) {
    struct relit_quad walls[6];
    char heard[128] = "", out[] = "/tmp/unbake-closed-XXXXXX";
    struct error err;
    cJSON *settings = cJSON_CreateObject();
    relit_cube(walls, rgb_gray(0.5f), rgb_gray(0.0f));
    char *dir = relit_outputs(walls, 6, CENTRE_VIEW);
    json_add_string(settings, "environment", "sky");
    json_add_string(settings, "date", "2024-06-21");
    json_add_number(settings, "latitude", 47.0);
    json_add_number(settings, "longitude", 8.5);
    json_add_int(settings, "spp", 4);
    CHECK(mkdtemp(out) != NULL);
    struct relight_job job = {.outputs = dir, .settings = settings, .out = out};
    struct relight_watch watch = {.user = heard, .message = hear};
    CHECK_THAT(relight_run(&job, &watch, pool, &err) == STATUS_OK, "%s", err.message);
    CHECK_STRING(heard, "picture 0 is black: no light reaches what it shows");
    cJSON_Delete(settings);
    CHECK(file_remove_tree(out, NULL) == STATUS_OK);
    relit_remove(dir);
}

struct progress_heard {
    double last;
    bool goes_back;
};
static void hear_progress(void *user, double done, double total) {
    struct progress_heard *heard = user;
    heard->goes_back = heard->goes_back || done < heard->last || done > total;
    heard->last = done;
}

/* Sources that are rendered alone are parts of their picture: progress never goes back. */
static void test_progress(void) {
    char *dir = lit_room(CENTRE_VIEW), out[] = "/tmp/unbake-progress-XXXXXX";
    struct error err;
    struct progress_heard heard = {0};
    cJSON *settings = cJSON_CreateObject();
    json_add_int(settings, "spp", 128);
    json_add_bool(settings, "per_light", true);
    CHECK(mkdtemp(out) != NULL);
    struct relight_job job = {.outputs = dir, .settings = settings, .out = out};
    struct relight_watch watch = {.user = &heard, .progress = hear_progress};
    CHECK_THAT(relight_run(&job, &watch, pool, &err) == STATUS_OK, "%s", err.message);
    CHECK(!heard.goes_back && heard.last == 1.0);
    cJSON_Delete(settings);
    CHECK(file_remove_tree(out, NULL) == STATUS_OK);
    relit_remove(dir);
}

/* Base colour as somebody has painted it over. */
static void paint(const char *dir) {
    struct image image;
    struct error err;
    char *path = file_join(dir, "base_color.exr");
    CHECK(relit_read(dir, "base_color.exr", &image, &err) == STATUS_OK);
    for (size_t i = 0; i < (size_t)image.width * image.height * image.channel_count; i++)
        image.pixel[i] *= 0.5f;
    CHECK(image_write_exr(path, &image, IMAGE_FLOAT, false, &err) == STATUS_OK);
    image_release(&image);
    mem_free(path);
}

struct kept {
    char name[2][64];
    int count;
};

/* Of the pictures that were there already, names with hashes of the files. */
static void note_kept(void *user, const char *name, const char *sha256) {
    struct kept *kept = user;
    CHECK(strlen(sha256) == SHA256_HEX_SIZE - 1);
    if (kept->count < 2)
        snprintf(kept->name[kept->count], sizeof kept->name[0], "%s", name);
    kept->count++;
}

/* A render that was stopped goes on where it was: what is there whole is not rendered again, but where the outputs are
 * others. */
static void test_resume(void) {
    char *dir = lit_room(CENTRE_VIEW), *out, *path;
    struct error err;
    static const char text[] = "{\"path\":\"0,0\",\"path_count\":3,\"spp\":4,\"format\":\"exr\"}";
    CHECK(relit_run(dir, text, pool, &out, &err) == STATUS_OK);
    char before[SHA256_HEX_SIZE], after[SHA256_HEX_SIZE];
    path = file_join(out, "00001_radiance.exr");
    char *other = file_join(out, "00002_radiance.exr");
    struct stat kept, now;
    CHECK(sha256_of_file(path, before, &err) == STATUS_OK && unlink(path) == 0 && stat(other, &kept) == 0);
    cJSON *settings = NULL;
    CHECK(json_parse(text, strlen(text), "settings", &settings, &err) == STATUS_OK);
    struct relight_job job = {.outputs = dir, .settings = settings, .out = out};
    struct kept found = {.count = 0};
    struct relight_watch watch = {.user = &found, .kept = note_kept};
    CHECK(relight_run(&job, &watch, pool, &err) == STATUS_OK);
    CHECK(found.count == 2);
    CHECK_STRING(found.name[0], "00000_radiance.exr");
    CHECK_STRING(found.name[1], "00002_radiance.exr");
    CHECK(sha256_of_file(path, after, &err) == STATUS_OK && strcmp(before, after) == 0);
    CHECK(stat(other, &now) == 0 && now.st_ino == kept.st_ino);
    paint(dir);
    CHECK(relight_run(&job, NULL, pool, &err) == STATUS_OK);
    CHECK(sha256_of_file(path, after, &err) == STATUS_OK && strcmp(before, after) != 0);
    cJSON_Delete(settings);
    mem_free(path);
    path = file_join(out, "views.json");
    CHECK(json_read(path, 1 << 20, &settings, &err) == STATUS_OK);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(settings, "seed")) == 7.0 && /* though none was given */
          cJSON_IsString(cJSON_GetObjectItem(settings, "unbake_version")));
    cJSON_Delete(settings);
    mem_free(path);
    mem_free(other);
    relit_remove(out);
    relit_remove(dir);
}

/* Names of pictures sort as their numbers do, however many there are. */
static void test_names(void) {
    static const char text[] = "{\"path\":\"0,0\",\"path_count\":100000,\"suns\":2,\"environment\":\"sky\","
                               "\"date\":\"2024-06-21\",\"latitude\":47,\"longitude\":8.5,\"spp\":4,\"size\":\"2x2\"}";
    char *dir = lit_room(CENTRE_VIEW), out[] = "/tmp/unbake-names-XXXXXX";
    struct error err;
    struct image image;
    cJSON *settings = NULL;
    CHECK(json_parse(text, strlen(text), "settings", &settings, &err) == STATUS_OK && mkdtemp(out) != NULL);
    struct relight_job job = {.outputs = dir, .settings = settings, .out = out, .first_view = 7, .view_count = 1};
    CHECK_THAT(relight_run(&job, NULL, pool, &err) == STATUS_OK, "%s", err.message);
    CHECK(relit_read(out, "000007_radiance.png", &image, &err) == STATUS_OK);
    image_release(&image);
    cJSON_Delete(settings);
    CHECK(file_remove_tree(out, NULL) == STATUS_OK);
    relit_remove(dir);
}

int main(void) {
    pool = parallel_new(2);
    test_lights();
    test_closed();
    test_progress();
    test_resume();
    test_names();
    parallel_free(pool);
    return check_result();
}
