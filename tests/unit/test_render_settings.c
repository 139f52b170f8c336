/* The table of a render's settings, and how values of it are checked. */
#include "common/render_settings.h"

#include "common/mem.h"
#include "tests/check.h"

static cJSON *parse(const char *text) {
    cJSON *value = NULL;
    struct error err;
    CHECK_THAT(json_parse(text, strlen(text), "test", &value, &err) == STATUS_OK, "%s: %s", text, err.message);
    return value;
}

static enum status check_text(const char *text, enum render_files files, cJSON *problems) {
    struct error err;
    cJSON *object = parse(text);
    enum status status = render_settings_check(object, files, problems, &err);
    cJSON_Delete(object);
    return status;
}

static void test_table(void) {
    size_t count;
    const struct render_setting *t = render_settings_table(&count);
    for (size_t i = 0; i < count; i++) {
        CHECK_THAT(i == 0 || strcmp(t[i - 1].name, t[i].name) < 0, "%s is out of order", t[i].name);
        CHECK(t[i].help && *t[i].help && t[i].unit && t[i].default_text);
        CHECK_THAT(render_settings_find(t[i].name, NULL) == &t[i] || strchr(t[i].name, '#'), "%s", t[i].name);
    }
    cJSON *described = render_settings_describe();
    CHECK(cJSON_GetArraySize(described) == (int)count);
    cJSON_Delete(described);
    uint32_t number;
    CHECK(render_settings_find("light.27", &number) && number == 27);
    CHECK(render_settings_find("lamp.3.kind", &number) && number == 3);
    CHECK(!render_settings_find("light.x", NULL) && !render_settings_find("light.", NULL));
    CHECK(!render_settings_find("light.07", NULL) && !render_settings_find("lamp.3", NULL));
    CHECK_STRING(render_settings_nearest("exposur"), "exposure");
}

static void test_good(void) {
    static const char *const good[] = {
        "{}",
        "{\"light.27\":\"2,1.8,1.2\",\"light.28\":\"off\",\"light.3\":2,\"light.4\":[1,2,3]}",
        "{\"passes\":\"radiance,depth,segment\",\"format\":\"both\",\"multilayer\":true,\"size\":\"640x480\"}",
        "{\"lamp.1.kind\":\"spot\",\"lamp.1.position\":\"0 1 2\",\"lamp.1.direction\":[0,-1,0],\"lamp.1.angle\":40}",
        "{\"environment\":\"sky\",\"date\":\"2024-02-29\",\"latitude\":47,\"longitude\":8.5,\"suns\":24}",
        "{\"environment\":\"sky.hdr\",\"environment_turn\":90,\"insert.1.file\":\"chair.glb\"}",
        "{\"luminance_per_unit\":120,\"unit\":\"nits\"}",
        "{\"unit\":\"nits\"}", /* the reconstruction may know */
    };
    for (size_t i = 0; i < sizeof good / sizeof *good; i++)
        CHECK_THAT(check_text(good[i], RENDER_FILES_ATTACHED, NULL) == STATUS_OK, "%s", good[i]);
}

/* Every fault is one problem with the name of its setting. */
static void test_faults(void) {
    static const struct {
        const char *settings, *name;
    } bad[] = {
        {"{\"view\":3}", "view"},
        {"{\"exposur\":1}", "exposur"},
        {"{\"spp\":1.5}", "spp"},
        {"{\"spp\":0}", "spp"},
        {"{\"light.27\":\"dim\"}", "light.27"},
        {"{\"light.27\":\"1,2\"}", "light.27"},
        {"{\"light.27\":-1}", "light.27"},
        {"{\"passes\":\"radiance,depht\"}", "passes"},
        {"{\"passes\":\"\"}", "passes"},
        {"{\"size\":\"640\"}", "size"},
        {"{\"size\":\"0x480\"}", "size"},
        {"{\"environment\":\"../sky.hdr\"}", "environment"},
        {"{\"environment\":\"sky\",\"date\":\"2023-02-29\",\"latitude\":47,\"longitude\":8.5}", "date"},
        {"{\"environment\":\"sky\",\"date\":\"2023-02-28\",\"longitude\":8.5}", "latitude"},
        {"{\"date\":\"2023-02-28\"}", "date"},
        {"{\"environment\":\"none\",\"environment_turn\":9}", "environment_turn"},
        {"{\"lamp.1.position\":\"0,0,0\"}", "lamp.1.kind"},
        {"{\"lamp.0.kind\":\"sphere\"}", "lamp.0.kind"},
        {"{\"lamp.1.kind\":\"sphere\",\"lamp.1.position\":\"0,0,0\",\"lamp.1.size\":\"1,1\"}", "lamp.1.size"},
        {"{\"lamp.1.kind\":\"area\",\"lamp.1.position\":\"0,0,0\"}", "lamp.1.direction"},
        {"{\"insert.1.scale\":2}", "insert.1.file"},
        {"{\"path\":\"0,1\",\"view\":\"0\"}", "view"},
        {"{\"path_count\":9}", "path_count"},
        {"{\"multilayer\":true}", "multilayer"},
        {"{\"sky\":\"dim\"}", "sky"},
        {"{\"environment\":\"none\",\"sky\":2}", "sky"},
        {"{\"environment\":\"a.hdr\",\"sun\":\"off\"}", "sun"},
        {"{\"precision\":\"half\"}", "precision"},
        {"{\"precision\":\"half\",\"multilayer\":true,\"format\":\"exr\"}", "precision"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        cJSON *problems = cJSON_CreateArray();
        CHECK(check_text(bad[i].settings, RENDER_FILES_ATTACHED, problems) == STATUS_INPUT);
        CHECK_THAT(cJSON_GetArraySize(problems) == 1, "%s", bad[i].settings);
        const cJSON *name = cJSON_GetObjectItem(cJSON_GetArrayItem(problems, 0), "name");
        CHECK_THAT(name && strcmp(name->valuestring, bad[i].name) == 0, "%s", bad[i].settings);
        cJSON_Delete(problems);
    }
    cJSON *problems = cJSON_CreateArray();
    CHECK(check_text("{\"spp\":0,\"seed\":-1,\"nosie\":1}", RENDER_FILES_ATTACHED, problems) == STATUS_INPUT);
    CHECK(cJSON_GetArraySize(problems) == 3);
    cJSON_Delete(problems);
    CHECK(check_text("{\"environment\":\"../sky.hdr\"}", RENDER_FILES_ANYWHERE, NULL) == STATUS_OK);
}

/* The names of all problems, in their order, with spaces between; the caller's. */
static char *names_of(cJSON *problems) {
    char *names = mem_strdup("");
    for (const cJSON *p = problems->child; p; p = p->next) {
        char *more = mem_printf("%s%s%s", names, *names ? " " : "", cJSON_GetObjectItem(p, "name")->valuestring);
        mem_free(names);
        names = more;
    }
    cJSON_Delete(problems);
    return names;
}

/* Settings that do not go together are told with those that are wrong by themselves; what one of these may have meant
 * is not guessed. */
static void test_faults_at_once(void) {
    static const struct {
        const char *settings, *names;
    } bad[] = {
        {"{\"nosie\":1,\"lamp.1.radius\":1,\"date\":\"2024-01-01\",\"path_count\":9,\"insert.2.scale\":2}",
         "nosie date path_count lamp.1.kind insert.2.file"},
        {"{\"environment\":\"sky\",\"date\":\"yesterday\",\"longitude\":8.5}", "date latitude"},
        {"{\"environment\":7,\"date\":\"2024-01-01\"}", "environment"},
        {"{\"lamp.1.kind\":\"tube\",\"lamp.1.size\":\"1,1\",\"lamp.2.kind\":\"spot\",\"lamp.2.position\":\"0\"}",
         "lamp.1.kind lamp.2.position lamp.2.direction"},
        {"{\"format\":\"jpg\",\"multilayer\":true,\"precision\":\"float\"}", "format"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        cJSON *problems = cJSON_CreateArray();
        CHECK(check_text(bad[i].settings, RENDER_FILES_ATTACHED, problems) == STATUS_INPUT);
        char *names = names_of(problems);
        CHECK_STRING(names, bad[i].names);
        mem_free(names);
    }
}

/* Segments and views that the room has not, all of them; where a list is not known nothing is said. */
static void test_room(void) {
    cJSON *report = parse("{\"segments\":[{\"segment\":0,\"name\":null},{\"segment\":1,\"name\":\"door\"}]}"),
          *frames = parse("[{\"file_path\":\"images/7.png\"},{\"file_path\":\"a\"}]"), *problems = cJSON_CreateArray();
    static const char bad[] = "{\"light.2\":\"off\",\"segment.1.roughness\":0.5,\"segment.9.emission\":\"1,1,1\","
                              "\"remove\":\"0,door,dor,2\",\"view\":\"0,images/7.png,2,b\"}";
    cJSON *settings = parse(bad);
    struct error err;
    CHECK(render_settings_check_room(settings, report, frames, problems, &err) == STATUS_INPUT);
    char *names = names_of(problems);
    CHECK_STRING(names, "light.2 segment.9.emission remove remove view view");
    mem_free(names);
    CHECK(render_settings_check_room(settings, NULL, NULL, NULL, &err) == STATUS_OK);
    CHECK(render_settings_need_report(settings));
    cJSON_Delete(settings);
    settings = parse("{\"light.1\":\"off\",\"remove\":\"door\",\"path\":\"a,0\"}");
    CHECK_THAT(render_settings_check_room(settings, report, frames, NULL, &err) == STATUS_OK, "%s", err.message);
    cJSON_Delete(settings);
    settings = parse("{\"lamp.1.lumen\":800,\"unit\":\"nits\"}");
    problems = cJSON_CreateArray();
    CHECK(render_settings_need_report(settings));
    CHECK(render_settings_check_room(settings, report, frames, problems, &err) == STATUS_INPUT);
    names = names_of(problems);
    CHECK_STRING(names, "lamp.1.lumen unit");
    mem_free(names);
    json_add(report, "luminance_per_unit", parse("{\"cd_per_m2\":100}"));
    CHECK(render_settings_check_room(settings, report, frames, NULL, &err) == STATUS_OK);
    cJSON_Delete(settings);
    settings = parse("{\"view\":\"all\"}");
    CHECK(render_settings_check_room(settings, report, frames, NULL, &err) == STATUS_OK);
    CHECK(!render_settings_need_report(settings));
    cJSON_Delete(settings);
    cJSON_Delete(report);
    cJSON_Delete(frames);
}

static void test_values(void) {
    cJSON *s =
        parse("{\"light.27\":\"2,1.8,1.2\",\"light.3\":\"off\",\"light.4\":0.5,\"lamp.2.position\":[1,2,3],"
              "\"size\":\"64x48\",\"passes\":\"depth,normal\",\"environment\":\"a.hdr\",\"insert.1.file\":\"a.hdr\"}");
    double v[RENDER_MAX_NUMBERS];
    uint32_t width, height;
    size_t count;
    CHECK(render_settings_number(s, "spp") == 64.0 && render_settings_bool(s, "denoise") == false);
    CHECK(render_settings_is(s, "lights", "on") && render_settings_is(s, "environment", "a.hdr"));
    CHECK(render_settings_lists(s, "passes", "depth") && !render_settings_lists(s, "passes", "radiance"));
    render_settings_factor(cJSON_GetObjectItem(s, "light.27"), v);
    CHECK(v[0] == 2.0 && v[1] == 1.8 && v[2] == 1.2);
    render_settings_factor(cJSON_GetObjectItem(s, "light.3"), v);
    CHECK(v[0] == 0.0 && v[2] == 0.0);
    render_settings_factor(cJSON_GetObjectItem(s, "light.4"), v);
    CHECK(v[0] == 0.5 && v[2] == 0.5);
    CHECK(render_settings_numbers(s, "lamp.2.position", v) && v[2] == 3.0);
    CHECK(render_settings_numbers(s, "lamp.2.radiance", v) && v[2] == 10.0);
    CHECK(!render_settings_numbers(s, "segment.2.base_color", v));
    CHECK(render_settings_size(s, &width, &height) && width == 64 && height == 48);
    uint32_t *lights = render_settings_family(s, "light.", &count);
    CHECK(count == 3 && lights[0] == 3 && lights[1] == 4 && lights[2] == 27);
    mem_free(lights);
    cJSON *files = render_settings_files(s);
    CHECK(cJSON_GetArraySize(files) == 1);
    cJSON_Delete(files);
    cJSON_Delete(s);
}

static void test_assignments(void) {
    cJSON *s = cJSON_CreateObject();
    struct error err;
    CHECK(render_settings_parse_assignment("spp=16", s, &err) == STATUS_OK);
    CHECK(render_settings_parse_assignment("denoise=true", s, &err) == STATUS_OK);
    CHECK(render_settings_parse_assignment("light.27=2,1,1", s, &err) == STATUS_OK);
    CHECK(render_settings_parse_assignment("view=3", s, &err) == STATUS_OK); /* a text: stays one */
    CHECK(render_settings_parse_assignment("spp=16", s, &err) == STATUS_INPUT);
    CHECK(render_settings_parse_assignment("spp", s, &err) == STATUS_INPUT);
    CHECK_THAT(render_settings_check(s, RENDER_FILES_ATTACHED, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(render_settings_number(s, "spp") == 16.0 && render_settings_is(s, "view", "3"));
    cJSON_Delete(s);
}

int main(void) {
    test_table();
    test_good();
    test_faults();
    test_faults_at_once();
    test_room();
    test_values();
    test_assignments();
    return check_result();
}
