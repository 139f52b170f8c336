/* The report's page: figures have names, units and what is good, settings their own names, lists of objects a head, and
 * what is empty is left out. */
#include "server/export/report_html.h"

#include <string.h>

#include "tests/check.h"

static const char *const report =
    "{\"settings\": {\"time_limit_sec\": 0, \"exclude\": \"\"}, \"up\": [0, 1, 0],"
    "\"metrics\": {\"msre\": 0.02, \"psnr_db\": 31},"
    "\"calibration\": {\"pose_shift_px\": 2.5, \"photographs\": [], \"vignette\": {}, \"mean_color_hdr\": true,"
    "\"registration\": {\"applied\": true, \"turn_degrees\": [0, 0.25, 0], \"turn_error_degrees\": [0.01, 0.02, 0.01],"
    "\"move_m\": [0, 0, 0.004], \"move_error_m\": [0.001, 0.002, 0.001]}},"
    "\"emitters\": [{\"segment\": 3, \"hidden\": false}, {\"segment\": 7, \"hidden\": true}],"
    "\"lights\": [], \"sun\": {},"
    "\"series\": {\"loss\": [[1, 0.5], [2, 0.25]], \"rays\": [[1, 9]], \"msre\": []}}";

static bool has(const struct buf *page, const char *words) {
    bool is = strstr(buf_text(page), words) != NULL;
    if (!is)
        fprintf(stderr, "no %s\n", words);
    return is;
}

static bool lacks(const struct buf *page, const char *words) { return strstr(buf_text(page), words) == NULL; }

int main(void) {
    struct error err = {0};
    struct buf out;
    cJSON *tree = cJSON_Parse(report);
    buf_init(&out, 1 << 20);
    CHECK(report_html(&(struct report_page){.title = "a <room>", .report = tree}, &out, &err) == STATUS_OK);
    CHECK(has(&out, "<h1>a &lt;room&gt;</h1>"));
    CHECK(has(&out, "<th>time_limit_sec</th><td>0</td>") && lacks(&out, "exclude"));
    CHECK(has(&out, "<th>up</th><td>0, 1, 0</td>"));
    CHECK(has(&out, "<th>mean squared relative error</th><td>0.02, 0 is best</td>"));
    CHECK(has(&out, "<th>PSNR in dB</th><td>31, 25 and more is good</td>"));
    CHECK(has(&out, "<th>pose shift, pixels</th><td>2.5</td>") && has(&out, "<th>mean colour HDR</th><td>yes</td>"));
    CHECK(has(&out, "<th>turn, degrees</th><td>0, 0.25, 0</td>") && has(&out, "<th>turn error, degrees</th><td>0.01,"));
    CHECK(has(&out, "<th>move, metres</th><td>0, 0, 0.004</td>") && has(&out, "<th>move error, metres</th><td>0.001,"));
    CHECK(lacks(&out, "photographs</th>") && lacks(&out, "vignette") && lacks(&out, "<b>lights") &&
          lacks(&out, "<b>sun"));
    CHECK(has(&out, "<tr><th>segment</th><th>hidden</th></tr><tr><td>3</td><td>no</td></tr><tr><td>7</td>"));
    CHECK(has(&out, "aria-label=\"loss, from 0.5 at step 1") && lacks(&out, "aria-label=\"rays"));
    cJSON_Delete(tree);
    buf_release(&out);
    return check_result();
}
