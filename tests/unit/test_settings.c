/* The settings table and the way values get into it. */
#include "common/settings.h"

#include "common/mem.h"
#include "tests/check.h"

static cJSON *parse(const char *text) {
    cJSON *value = NULL;
    struct error err;
    CHECK(json_parse(text, strlen(text), "test", &value, &err) == STATUS_OK);
    return value;
}

static void test_table(void) {
    size_t count;
    const struct setting *t = settings_table(&count);
    struct settings s;
    settings_init(&s);
    for (size_t i = 0; i < count; i++) {
        CHECK_THAT(i == 0 || strcmp(t[i - 1].name, t[i].name) < 0, "%s is out of order", t[i].name);
        CHECK(t[i].help && *t[i].help && t[i].unit);
        if (t[i].type == SETTING_INT || t[i].type == SETTING_REAL)
            CHECK_THAT(s.number[i] >= t[i].minimum && s.number[i] <= t[i].maximum, "default of %s is out of its range",
                       t[i].name);
    }
    /* What settings_to_json writes, settings_apply reads back without a complaint. */
    cJSON *json = settings_to_json(&s);
    struct error err;
    CHECK(settings_apply(&s, json, NULL, &err) == STATUS_OK);
    cJSON *described = settings_describe();
    CHECK(cJSON_GetArraySize(described) == (int)count);
    cJSON_Delete(described);
    cJSON_Delete(json);
    settings_release(&s);
}

static void test_problems_all_at_once(void) {
    struct settings s;
    settings_init(&s);
    cJSON *object = parse("{\"texture_sise\":1,\"seed\":-1,\"iterations\":1.5,\"method\":\"x\","
                          "\"texture_size\":512,\"transforms\":\"\"}");
    cJSON *problems = cJSON_CreateArray();
    struct error err;
    CHECK(settings_apply(&s, object, problems, &err) == STATUS_INPUT);
    CHECK(cJSON_GetArraySize(problems) == 5);
    const cJSON *first = cJSON_GetArrayItem(problems, 0);
    const char *hint = NULL;
    CHECK(json_string(first, "hint", "problem", "", &hint, &err) == STATUS_OK);
    CHECK_STRING(hint, "did you mean texture_size?");
    CHECK_NEAR(settings_number(&s, "texture_size"), 512, 0);
    CHECK_NEAR(settings_number(&s, "seed"), 1, 0);
    cJSON_Delete(problems);
    cJSON_Delete(object);
    settings_release(&s);
}

/* How many problems settings of that text have; *reason: of the last. */
static int problems_of(const char *text, char reason[200]) {
    struct settings s;
    struct error err;
    cJSON *object = parse(text), *problems = cJSON_CreateArray();
    settings_init(&s);
    enum status status = settings_apply(&s, object, problems, &err);
    int count = cJSON_GetArraySize(problems);
    CHECK((status == STATUS_OK) == (count == 0));
    const cJSON *last = cJSON_GetArrayItem(problems, count - 1);
    snprintf(reason, 200, "%s", count ? cJSON_GetStringValue(cJSON_GetObjectItem(last, "reason")) : "");
    cJSON_Delete(problems);
    cJSON_Delete(object);
    settings_release(&s);
    return count;
}

/* What the method would not look at is a problem, wherever the method stands. */
static void test_method(void) {
    char reason[200];
    CHECK(problems_of("{\"emitters\":\"any\"}", reason) == 1);
    CHECK_STRING(reason, "only method=listing1 uses it, and the method is solve");
    CHECK(problems_of("{\"denoise\":false,\"gather_samples\":64,\"method\":\"listing1\"}", reason) == 2);
    CHECK_STRING(reason, "only method=solve uses it, and the method is listing1");
    CHECK(problems_of("{\"base_color_rate\":0.1,\"roughness_rate\":0.1,\"specular_rate\":0.1}", reason) == 3);
    CHECK(problems_of("{\"emitters\":\"any\",\"method\":\"listing1\"}", reason) == 0);
    CHECK(problems_of("{\"method\":\"solve\",\"denoise\":false,\"estimates\":\"one\",\"choose\":\"pixels\"}", reason) ==
          0);
    /* The default changes nothing; a method that is none has no settings of its own. */
    CHECK(problems_of("{\"emitters\":\"decide\"}", reason) == 0);
    CHECK(problems_of("{\"emitters\":\"any\",\"method\":\"guess\"}", reason) == 1);
}

static double number_of(const char *text, const char *name) {
    struct settings s;
    struct error err;
    cJSON *object = parse(text);
    settings_init(&s);
    CHECK_THAT(settings_apply(&s, object, NULL, &err) == STATUS_OK, "%s", err.message);
    double number = settings_number(&s, name);
    cJSON *full = settings_to_json(&s); /* what a report lists gives the same again, whatever quality it names */
    struct settings again;
    settings_init(&again);
    CHECK(settings_apply(&again, full, NULL, &err) == STATUS_OK && settings_number(&again, name) == number);
    settings_release(&again);
    cJSON_Delete(full);
    cJSON_Delete(object);
    settings_release(&s);
    return number;
}

/* Quality says what is not given, wherever it stands. */
static void test_quality(void) {
    CHECK(number_of("{}", "gather_samples") == 512.0 && number_of("{}", "refine_looks") == 1000.0);
    CHECK(number_of("{\"quality\":\"draft\"}", "gather_samples") == 128.0);
    CHECK(number_of("{\"quality\":\"fine\"}", "report_samples") == 256.0);
    CHECK(number_of("{\"gather_samples\":512,\"quality\":\"draft\"}", "gather_samples") == 512.0);
    CHECK(number_of("{\"quality\":\"draft\",\"refine_looks\":7}", "refine_looks") == 7.0);
    CHECK(number_of("{\"quality\":\"draft\",\"method\":\"listing1\"}", "listing1_looks") == 400.0);
    CHECK(number_of("{\"quality\":\"fine\"}", "texture_size") == 2048.0);
    /* The rows of quality agree with the defaults of the table. */
    cJSON *described = settings_describe();
    const cJSON *entry;
    int count = 0;
    cJSON_ArrayForEach(entry, described) {
        const cJSON *amounts = cJSON_GetObjectItem(entry, "by_quality");
        double wanted = cJSON_GetNumberValue(cJSON_GetObjectItem(amounts, "standard"));
        const struct setting *t = settings_find(cJSON_GetStringValue(cJSON_GetObjectItem(entry, "name")));
        CHECK(!amounts || strtod(t->default_text, NULL) == wanted);
        count += amounts != NULL;
    }
    CHECK(count == 8);
    cJSON_Delete(described);
}

static void test_assignments(void) {
    cJSON *object = cJSON_CreateObject();
    struct error err;
    CHECK(settings_parse_assignment("texture_size=256", object, &err) == STATUS_OK);
    CHECK(settings_parse_assignment("method=listing1", object, &err) == STATUS_OK);
    CHECK(settings_parse_assignment("seed=abc", object, &err) == STATUS_OK);
    CHECK(settings_parse_assignment("texture_size=1", object, &err) == STATUS_INPUT);
    CHECK(settings_parse_assignment("novalue", object, &err) == STATUS_INPUT);
    CHECK(settings_parse_assignment("=3", object, &err) == STATUS_INPUT);
    char *text = json_text(object);
    CHECK_STRING(text, "{\"texture_size\":256,\"method\":\"listing1\",\"seed\":\"abc\"}");
    mem_free(text);
    struct settings s;
    settings_init(&s);
    CHECK(settings_apply(&s, object, NULL, &err) == STATUS_INPUT);
    CHECK(settings_is(&s, "method", "listing1"));
    CHECK_STRING(settings_text(&s, "transforms"), "transforms.json");
    settings_release(&s);
    cJSON_Delete(object);
}

/* What a user says of single segments, and of a box. */
static void test_user_corrections(void) {
    static const char *const faults[] = {"{\"emitters.x\":\"on\"}",
                                         "{\"emitters.\":\"on\"}",
                                         "{\"emitters.1\":true}",
                                         "{\"emitters.1\":\"yes\"}",
                                         "{\"crop\":\"1 2 3 4 5\"}",
                                         "{\"crop\":\"0 0 0 1 1 1 1\"}",
                                         "{\"crop\":\"0 0 0 1 0 1\"}",
                                         "{\"grey_card\":\"a.jpg\"}",
                                         "{\"grey_card\":\"a.jpg,1,0.5\"}",
                                         "{\"grey_card\":\",1,2,0.5\"}",
                                         "{\"grey_card\":\"a.jpg,1,2,0\"}",
                                         "{\"grey_card\":\"a.jpg,1,2,1.1\"}",
                                         "{\"grey_card\":\"a.jpg,1.5,2,.5\"}",
                                         "{\"grey_card\":\"a.jpg,-1,2,.5\"}",
                                         "{\"grey_card\":\"a.jpg,1,2,\"}",
                                         "{\"grey_card\":\"a.jpg,1,2x,.5\"}",
                                         "{\"grey_card\":[1,2]}",
                                         "{\"emitters.1\":\"on\",\"emitters\":\"any\","
                                         "\"method\":\"listing1\"}"};
    struct error err;
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        struct settings s;
        cJSON *json = cJSON_Parse(faults[i]);
        settings_init(&s);
        CHECK_THAT(settings_apply(&s, json, NULL, &err) == STATUS_INPUT, "%s", faults[i]);
        settings_release(&s);
        cJSON_Delete(json);
    }
    cJSON *json = cJSON_Parse(
        "{\"emitters.27\":\"on\",\"emitters.3\":\"off\",\"crop\":\"-1,0 .5 2 3 4\",\"grey_card\":\"a, b.jpg,12, 34,.18\"}");
    struct settings s, again;
    settings_init(&s);
    settings_init(&again);
    CHECK(settings_apply(&s, json, NULL, &err) == STATUS_OK);
    cJSON *all = settings_to_json(&s);
    CHECK_THAT(settings_apply(&again, all, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(settings_emitter(&again, 27, false) && !settings_emitter(&again, 3, true));
    CHECK(settings_emitter(&again, 4, true) && !settings_emitter(&again, 4, false));
    double lower[3], upper[3];
    CHECK(settings_box(&again, "crop", lower, upper) && lower[0] == -1.0 && lower[2] == 0.5 && upper[2] == 4.0);
    struct pixel_setting pixel;
    CHECK(settings_pixel(&again, "grey_card", &pixel) && pixel.x == 12 && pixel.y == 34 && pixel.value == 0.18);
    CHECK_STRING(pixel.photograph, "a, b.jpg");
    cJSON_Delete(all);
    cJSON_Delete(json);
    settings_release(&s);
    settings_release(&again);
    settings_init(&s);
    CHECK(!settings_pixel(&s, "grey_card", &pixel));
    settings_release(&s);
}

int main(void) {
    test_user_corrections();
    test_table();
    test_problems_all_at_once();
    test_method();
    test_quality();
    test_assignments();
    return check_result();
}
