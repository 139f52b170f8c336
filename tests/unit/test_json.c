/* json.h: what it refuses beyond cJSON, and where it says the fault is. */
#include "common/json.h"

#include <dirent.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

static enum status parse(const char *text, struct error *err) {
    cJSON *value = NULL;
    enum status status = json_parse(text, strlen(text), "body", &value, err);
    cJSON_Delete(value);
    return status;
}

static void test_refusals(void) {
    struct error err;
    CHECK(parse("{\"a\":1,\n \"a\":2}", &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "body has the key \"a\" twice in one object");
    CHECK(parse("{}\n x", &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "body has text after the JSON at line 2, column 2");
    CHECK(parse("{\"a\":\n  tru}", &err) == STATUS_INPUT);
    CHECK(strstr(err.message, "line 2") != NULL);
    CHECK(parse("\"\xc0\xaf\"", &err) == STATUS_INPUT);
    CHECK(parse("", &err) == STATUS_INPUT);
    /* cJSON takes these for "a", and for the key "k". */
    CHECK(parse("{\"s\":\n\"a\\u0000b\"}", &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "body has a string with a NUL character (\\u0000) at line 2, column 3");
    CHECK(parse("[[{\"k\\u0000x\":1}]]", &err) == STATUS_INPUT);
    CHECK(parse("\"\\\\\\u0000\"", &err) == STATUS_INPUT);
    CHECK(parse("\"\\\\u0000 \\u00001\"", &err) == STATUS_INPUT);
    CHECK(parse("\"\\\\u0000 \\u0001 u0000\"", &err) == STATUS_OK);
    char deep[400];
    memset(deep, '[', sizeof deep);
    deep[sizeof deep - 1] = '\0';
    CHECK(parse(deep, &err) == STATUS_INPUT);
    CHECK(strstr(err.message, "nested") != NULL);
    CHECK(parse(" {\"a\": [1, 2.5e3, \"\\u00e9\", null, true]} \n", &err) == STATUS_OK);
}

static void test_members(void) {
    cJSON *object = NULL;
    struct error err;
    const char *text = "{\"n\":2.5,\"s\":\"x\",\"b\":true,\"z\":null,\"i\":1e999}";
    CHECK(json_parse(text, strlen(text), "body", &object, &err) == STATUS_OK);
    double n;
    const char *s;
    bool b;
    CHECK(json_number(object, "n", "body", 0, &n, &err) == STATUS_OK && n == 2.5);
    CHECK(json_number(object, "z", "body", 7, &n, &err) == STATUS_OK && n == 7);
    CHECK(json_number(object, "s", "body", 7, &n, &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "body: \"s\" must be a number, found a string");
    CHECK(json_number(object, "i", "body", 7, &n, &err) == STATUS_INPUT && n == 7);
    CHECK_STRING(err.message, "body: \"i\" is not a finite number");
    CHECK(json_string(object, "s", "body", NULL, &s, &err) == STATUS_OK && strcmp(s, "x") == 0);
    CHECK(json_bool(object, "b", "body", false, &b, &err) == STATUS_OK && b);
    CHECK(json_bool(object, "n", "body", false, &b, &err) == STATUS_INPUT);
    cJSON_Delete(object);
    CHECK(json_read("/nonexistent.json", 100, &object, &err) == STATUS_NOT_FOUND && object == NULL);
    CHECK(json_read("/dev/null", 100, &object, &err) == STATUS_INPUT && object == NULL);
}

/* What a terminal would obey or hide is escaped; what people write is not. */
static void test_invisible(void) {
    cJSON *object = cJSON_CreateObject();
    json_add_string(object, "\u202Ea", "\x7f\n\xC2\x9B\u2069\u200E\uFEFF\U000E0041 \u00E4\u20AC\U0001F600");
    char *text = json_text(object);
    CHECK_STRING(text,
                 "{\"\\u202ea\":\"\\u007f\\n\\u009b\\u2069\\u200e\\ufeff\\udb40\\udc41 \u00E4\u20AC\U0001F600\"}");
    cJSON *read = cJSON_Parse(text);
    CHECK(cJSON_Compare(object, read, true));
    cJSON_Delete(read);
    cJSON_Delete(object);
    mem_free(text);
}

static void test_numbers(void) {
    static const struct {
        double number;
        const char *text;
    } cases[] = {
        {0, "0"},
        {-7, "-7"},
        {2147483648.0, "2147483648"},
        {9007199254740991.0, "9007199254740991"},
        {-9007199254740991.0, "-9007199254740991"},
        {0.1, "0.1"},
        {1e300, "1e+300"},
        {0.1 + 0.2, "0.30000000000000004"},
        {1.0 / 3.0, "0.33333333333333331"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        cJSON *object = cJSON_CreateObject(), *list = cJSON_AddArrayToObject(object, "list");
        cJSON_AddItemToArray(list, cJSON_CreateNumber(cases[i].number));
        char *wanted = mem_printf("{\"list\":[%s]}", cases[i].text), *text = json_text(object);
        CHECK_STRING(text, wanted);
        cJSON *read = cJSON_Parse(text);
        CHECK(cJSON_GetArrayItem(cJSON_GetObjectItem(read, "list"), 0)->valuedouble == cases[i].number);
        cJSON_Delete(read);
        cJSON_Delete(object);
        mem_free(wanted);
        mem_free(text);
    }
}

/* The public suite of JSON parsing: y_ must be taken, n_ refused, i_ may be either; none may
 * crash. cJSON is lenient about numbers and control characters, hence the allowance. */
static void test_suite(void) {
    char dir_path[1024];
    snprintf(dir_path, sizeof dir_path, "%s", check_data("vectors/json-suite/test_parsing"));
    DIR *dir = opendir(dir_path);
    CHECK(dir != NULL);
    size_t taken_wrongly = 0, refused_wrongly = 0, seen = 0;
    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;) {
        if (e->d_name[0] == '.')
            continue;
        char *file = file_join(dir_path, e->d_name);
        struct buf content;
        struct error err;
        buf_init(&content, 16 << 20);
        CHECK(file_read(file, &content, &err) == STATUS_OK);
        cJSON *value = NULL;
        enum status status = json_parse(buf_text(&content), content.length, e->d_name, &value, &err);
        seen++;
        if (e->d_name[0] == 'y' && status != STATUS_OK) {
            refused_wrongly++;
            printf("refused: %s: %s\n", e->d_name, err.message);
        }
        if (e->d_name[0] == 'n' && status == STATUS_OK) {
            taken_wrongly++;
            printf("taken: %s\n", e->d_name);
        }
        cJSON_Delete(value);
        buf_release(&content);
        mem_free(file);
    }
    if (dir)
        closedir(dir);
    CHECK_THAT(refused_wrongly <= 4, /* keys that come twice, and NUL */
               "%zu valid texts refused", refused_wrongly);
    CHECK_THAT(taken_wrongly <= 30, "%zu invalid texts taken", taken_wrongly);
    CHECK(seen > 300);
}

/* What is no UTF-8 is made so: what we write can always be read. */
static void test_strings(void) {
    static const char *const pairs[][2] = {{"Küche", "Küche"},
                                           {"K\xC3", "K?"},
                                           {"\xFF\xFE"
                                            "a",
                                            "??a"},
                                           {"a\xE2\x82 b", "a?? b"},
                                           {"", ""}};
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        cJSON *object = cJSON_CreateObject();
        json_add_string(object, "a", pairs[i][0]);
        CHECK_STRING(cJSON_GetStringValue(object->child), pairs[i][1]);
        cJSON_Delete(object);
    }
}

/* As many keys as a request's body holds: done at once, not pair by pair (which takes minutes). */
static void test_many_keys(void) {
    enum { COUNT = 100000 };
    struct buf text;
    cJSON *value;
    buf_init(&text, 1 << 22);
    buf_puts(&text, "{");
    for (int i = 0; i < COUNT; i++)
        buf_printf(&text, "\"%x\":%d,", (unsigned)i * 2654435761u, i);
    size_t length = text.length;
    buf_puts(&text, "\"last\":0}");
    CHECK(json_parse(buf_text(&text), text.length, "keys", &value, NULL) == STATUS_OK);
    cJSON_Delete(value);
    text.length = length;
    buf_puts(&text, "\"0\":0}");
    CHECK(json_parse(buf_text(&text), text.length, "keys", &value, NULL) == STATUS_INPUT);
    buf_release(&text);
}

int main(void) {
    test_strings();
    test_many_keys();
    test_refusals();
    test_members();
    test_invisible();
    test_numbers();
    test_suite();
    return check_result();
}
