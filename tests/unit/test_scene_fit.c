/* server/job/scene_fit.h: a job reads its scene as the check has found that it is to be read, else as it was given,
 * whatever a worker has told; and is refused where mesh and photographs do not fit. */
#include "server/job/scene_fit.h"

#include "common/mem.h"
#include "server/store/store.h"
#include "tests/check.h"

static void check_reading(const char *facts, const char *given, const char *wanted) {
    struct scene_row row = {.facts = (char *)(uintptr_t)facts, .reading = (char *)(uintptr_t)given};
    cJSON *reading = scene_fit_reading(&row);
    char *text = json_text(reading);
    CHECK_STRING(text, wanted);
    mem_free(text);
    cJSON_Delete(reading);
}

static void check_fit(const char *facts, enum status wanted, const char *part, const char *remedy) {
    struct scene_row row = {.id = "0123456789abcdef", .facts = (char *)(uintptr_t)facts};
    struct error err = {.message = ""};
    cJSON *known;
    CHECK_THAT(scene_fit_check(&row, &known, &err) == wanted, "%s: %s", facts, err.message);
    CHECK_THAT(strstr(err.message, part) || strstr(err.hint, part), "%s: %s; %s", facts, err.message, err.hint);
    char *text = known ? json_text(known) : mem_strdup("");
    CHECK_STRING(text, remedy);
    mem_free(text);
    cJSON_Delete(known);
    CHECK(scene_fit_check(&row, NULL, &err) == wanted);
}

int main(void) {
    check_reading("{\"reading\":{\"scale\":2}}", "{\"scale\":1.5}", "{\"scale\":2}");
    check_reading("{\"reading\":{}}", "{\"scale\":1.5}", "{}");
    check_reading("{}", "{\"scale\":1.5}", "{\"scale\":1.5}");
    check_reading("{\"reading\":7}", "{\"scale\":1.5}", "{\"scale\":1.5}");
    check_reading("not JSON", "nor this", "{}");

    check_fit("{}", STATUS_OK, "", "");
    check_fit("{\"fit\":{\"verdict\":\"doubtful\"}}", STATUS_OK, "", "");
    check_fit("{\"fit\":{\"verdict\":\"no\"}}", STATUS_CONFLICT, "fit=ignore", "");
    check_fit("{\"fit\":{\"verdict\":\"no\",\"evidence\":[\"rays hit nothing\"],\"remedy\":{\"lens\":0.5}}}",
              STATUS_CONFLICT, "unbake scenes set 0123456789ab lens=0.5", "{\"lens\":0.5}");
    check_fit("{\"fit\":{\"verdict\":\"no\",\"evidence\":\"x\",\"remedy\":[1]}}", STATUS_CONFLICT, "fit=ignore", "");
    check_fit("{\"fit\":{\"verdict\":\"no\",\"evidence\":[\"all rays hit it\",\"pictures differ\"],\"remedy\":null}}",
              STATUS_CONFLICT, "do not fit: pictures differ", ""); /* the last decided */
    check_fit("{\"fit\":[\"no\"]}", STATUS_OK, "", "");
    return check_result();
}
