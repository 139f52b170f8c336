/* The report's verdict says what its figures mean, and speaks of nothing that is not known. */
#include "server/export/report_verdict.h"

#include <string.h>

#include "tests/check.h"

static bool says(const char *json, const char *words) {
    struct buf out;
    buf_init(&out, 1 << 16);
    cJSON *report = cJSON_Parse(json);
    CHECK(report != NULL);
    report_verdict(&out, report);
    bool is = strstr(buf_text(&out), words) != NULL;
    cJSON_Delete(report);
    buf_release(&out);
    return is;
}

int main(void) {
    const char *good =
        "{\"metrics\": {\"held_out_views\": 6, \"psnr_db\": 31.4, \"msre\": 0.01, \"msre_noise_left\": 0.001},"
        "\"seen_surface_share\": 0.99, \"prepare\": {\"training_photographs\": 54},"
        "\"segments\": [{\"emitter\": true}, {\"emitter\": false}], \"sun\": {\"found\": false},"
        "\"lights\": [{\"kind\": \"segment\", \"deviation\": 0.05}]}";
    CHECK(says(good, "of 2 segments; 1 of them shines."));
    CHECK(says(good, "6 held-out views is hard to tell from the photograph: 31.4 dB"));
    CHECK(says(good, "No weakness is known"));
    CHECK(!says(good, "noise of the re-render"));
    const char *bad =
        "{\"metrics\": {\"held_out_views\": 1, \"psnr_db\": 18, \"msre\": 0.86, \"msre_noise_left\": 0.80},"
        "\"seen_surface_share\": 0.59, \"prepare\": {\"training_photographs\": 5},"
        "\"unseen_light\": {\"share_of_rays\": 0.2}, \"sun\": {\"found\": true},"
        "\"lights\": [{\"kind\": \"hidden\", \"deviation\": 0.5}, {\"kind\": \"hidden\", \"deviation\": 0.1}, "
        "{\"kind\": \"saturated_sky\", \"deviation\": 0.1}, {\"kind\": \"sun\", \"deviation\": 0.1}]}";
    CHECK(says(bad, "no segment shines; the sun shines in"));
    CHECK(says(bad, "1 held-out view is far from the photograph: 18.0 dB"));
    CHECK(says(bad, "squared relative error uncertain: 0.86, give or take 0.8"));
    CHECK(says(bad, "41 % of the surface is in no photograph"));
    CHECK(says(bad, "Few photographs: 5."));
    CHECK(says(bad, "20 % of the light's directions"));
    CHECK(says(bad, "2 sources of light in no photograph"));
    CHECK(says(bad, "2 sources of light too bright for every photograph")); /* the sun is one */
    CHECK(says(bad, "brightness of 1 source of light is uncertain: the standard deviation is up to 50 %"));
    CHECK(!says(bad, "No weakness is known"));
    CHECK(says("{\"calibration\": {\"contrast_unknown\": true}}", "The exposures of the photographs are not told"));
    CHECK(!says("{\"calibration\": {\"contrast_unknown\": false}}", "not told"));
    CHECK(says("{\"lit\": false}", "Nothing that shines was found"));
    CHECK(!says("{\"lit\": true}", "Nothing that shines") && !says(good, "Nothing that shines"));
    const char *holes =
        "{\"holes\": {\"filled\": 2, \"filled_m2\": 145.2, \"openings_kept\": 1, \"openings_m2\": 0.5}}";
    CHECK(says(holes, "2 holes of the mesh were filled, 145 m²"));
    CHECK(says(holes, "1 opening of the mesh, 0.5 m², is taken for a way out"));
    CHECK(!says(good, "of the mesh"));
    CHECK(!says(holes, "nothing was scanned"));
    const char *openings = "{\"holes\": {\"filled\": 1}, \"lights\": [{\"kind\": \"opening\", \"added\": true}, "
                           "{\"kind\": \"hidden\", \"added\": false}, {\"kind\": \"hidden\", \"added\": true}, "
                           "{\"kind\": \"opening\", \"added\": true}]}";
    CHECK(says(openings, "Light comes in from 2 places where nothing was scanned"));
    CHECK(says(openings, "1 piece of surface was added where the scan has none"));
    CHECK(!says(bad, "outlines") && !says(good, "outlines"));
    const char *outlines = "{\"metrics\": {\"held_out_views\": 1, \"psnr_db\": 25, \"msre\": 0.1, "
                           "\"msre_at_outlines\": 0.06, \"outline_share\": 0.05}, \"seen_surface_share\": 1,"
                           "\"segments\": [{\"emitter\": true, \"name\": \"lamp <a>\"}, {\"name\": \"wall\"}, "
                           "{\"emitter\": true, \"name\": \"lamp <a>\"}, {\"emitter\": true}]}";
    CHECK(says(outlines, "60 % of the error lies beside outlines, on 5 % of the pixels"));
    CHECK(!says(outlines, "No weakness is known"));
    CHECK(says(outlines, "of 4 segments; 3 of them shine (lamp &lt;a&gt;)."));
    CHECK(says("{}", "No photograph was held out"));
    CHECK(!says("{}", "of the surface"));
    return check_result();
}
