/* report_verdict.c -- see report_verdict.h. */
#include "server/export/report_verdict.h"

#include <math.h>
#include <string.h>

#include "server/export/html.h"

/* PSNR in dB from which two pictures look alike to most, and from which they differ only in detail: rules of thumb of
 * picture coding, for the words alone. */
#define PSNR_CLOSE 30.0
#define PSNR_GOOD 25.0
#define PSNR_FAIR 20.0
#define SEEN_WHOLE 0.95     /* of the surface: less is said */
#define FEW_PHOTOGRAPHS 20  /* of the training; fewer is said */
#define UNSEEN_LIGHT 0.05   /* of the rays that leave the room where no photograph shows what is there */
#define UNCERTAIN_LIGHT 0.3 /* relative deviation of a source's radiance */
#define NAMES_SHOWN 4       /* of lamps */
#define OUTLINE_PART 0.25   /* of the error of held-out views beside outlines; */
#define OUTLINE_TIMES 2.0   /* and of what as many pixels elsewhere have */
#define NOISE_DISTURBS 0.2  /* standard error of the error of held-out views, by the re-renders' noise */

/* A number by its path of two names; NAN where it is not there. */
static double number_at(const cJSON *report, const char *first, const char *second) {
    const cJSON *at = cJSON_GetObjectItemCaseSensitive(report, first);
    at = second ? cJSON_GetObjectItemCaseSensitive(at, second) : at;
    return cJSON_IsNumber(at) ? at->valuedouble : NAN;
}

static bool is_true(const cJSON *object, const char *name) {
    return cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(object, name));
}

/* In brackets, once each; nothing without names. */
static void put_lamp_names(struct buf *out, const cJSON *segments) {
    const char *shown[NAMES_SHOWN];
    const cJSON *s;
    size_t count = 0;
    bool has_more = false;
    cJSON_ArrayForEach(s, segments) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(s, "name"));
        bool is_new = name && is_true(s, "emitter");
        for (size_t i = 0; i < count && is_new; i++)
            is_new = strcmp(shown[i], name) != 0;
        has_more = has_more || (is_new && count == NAMES_SHOWN);
        if (!is_new || count == NAMES_SHOWN)
            continue;
        buf_puts(out, count == 0 ? " (" : ", ");
        html_text(out, name);
        shown[count++] = name;
    }
    if (count > 0)
        buf_puts(out, has_more ? ", …)" : ")");
}

static void put_found(struct buf *out, const cJSON *report) {
    const cJSON *segments = cJSON_GetObjectItemCaseSensitive(report, "segments"), *s;
    int count = cJSON_GetArraySize(segments), lamps = 0;
    cJSON_ArrayForEach(s, segments)
        lamps += is_true(s, "emitter");
    buf_printf(out, "<p>Found: base colour, roughness and specular of %d segment%s; ", count, count == 1 ? "" : "s");
    if (lamps == 0)
        buf_puts(out, "no segment shines");
    else
        buf_printf(out, lamps == 1 ? "1 of them shines" : "%d of them shine", lamps);
    put_lamp_names(out, segments);
    if (is_true(cJSON_GetObjectItemCaseSensitive(report, "sun"), "found"))
        buf_puts(out, "; the sun shines in");
    buf_puts(out, ".</p>");
}

/* Lights of a kind whose surface was added to the mesh. */
static int count_added(const cJSON *report, const char *of_kind) {
    const cJSON *light;
    int count = 0;
    cJSON_ArrayForEach(light, cJSON_GetObjectItemCaseSensitive(report, "lights")) {
        const char *kind = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(light, "kind"));
        count += kind && strcmp(kind, of_kind) == 0 && is_true(light, "added");
    }
    return count;
}

/* Lamps that stand for what lies behind gaps of the mesh, or where no photograph looks. */
static void put_added_lights(struct buf *out, const cJSON *report) {
    int openings = count_added(report, "opening"), lamps = count_added(report, "hidden");
    if (openings > 0)
        buf_printf(out,
                   "<p>Light comes in from %d place%s where nothing was scanned: the lamps that are named “opening” "
                   "stand outside the mesh, as bright as what they light tells.</p>",
                   openings, openings == 1 ? "" : "s");
    if (lamps > 0)
        buf_printf(
            out,
            "<p>%d piece%s of surface %s added where the scan has none and no photograph looks, since a lamp must "
            "be there: those that are named “hidden lamp”, as bright as what they light tells.</p>",
            lamps, lamps == 1 ? "" : "s", lamps == 1 ? "was" : "were");
}

/* What was done about the holes of the mesh. */
static void put_holes(struct buf *out, const cJSON *report) {
    double filled = number_at(report, "holes", "filled"), kept = number_at(report, "holes", "openings_kept");
    if (filled > 0.0)
        buf_printf(
            out,
            "<p>%.0f hole%s of the mesh %s filled, %.3g m², where photographs or what is all around show a surface.</p>",
            filled, filled == 1.0 ? "" : "s", filled == 1.0 ? "was" : "were", number_at(report, "holes", "filled_m2"));
    if (kept > 0.0)
        buf_printf(out,
                   "<p>%.0f opening%s of the mesh, %.3g m², %s taken for a way out of the room: a window, a door.</p>",
                   kept, kept == 1.0 ? "" : "s", number_at(report, "holes", "openings_m2"), kept == 1.0 ? "is" : "are");
    put_added_lights(out, report);
}

static void put_views(struct buf *out, const cJSON *report) {
    double views = number_at(report, "metrics", "held_out_views"), psnr = number_at(report, "metrics", "psnr_db");
    double error = number_at(report, "metrics", "msre"), noise = number_at(report, "metrics", "msre_noise_left");
    if (!(views > 0.0) || !isfinite(psnr)) {
        buf_puts(out, "<p>No photograph was held out, so that nothing here says how far the result is off.</p>");
        return;
    }
    const char *word = psnr >= PSNR_CLOSE  ? "is hard to tell from the photograph"
                       : psnr >= PSNR_GOOD ? "agrees with the photograph but for details"
                       : psnr >= PSNR_FAIR ? "differs visibly from the photograph"
                                           : "is far from the photograph";
    buf_printf(out, "<p>A re-render of the %.0f held-out view%s %s: %.1f dB PSNR in the mean (%.0f and more is good).",
               views, views == 1.0 ? "" : "s", word, psnr, PSNR_GOOD);
    if (noise > NOISE_DISTURBS * error)
        buf_printf(out,
                   " The noise of the re-render leaves the squared relative error uncertain: %.3g, give or take %.2g. "
                   "report_samples makes that less.",
                   error, noise);
    buf_puts(out, "</p>");
}

static void put_lights(struct buf *out, const cJSON *report, int *reasons) {
    const cJSON *light;
    int uncertain = 0, hidden = 0, saturated = 0;
    double most = 0.0;
    cJSON_ArrayForEach(light, cJSON_GetObjectItemCaseSensitive(report, "lights")) {
        double deviation = number_at(light, "deviation", NULL);
        const char *kind = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(light, "kind"));
        hidden += kind && strcmp(kind, "hidden") == 0;
        saturated += kind && (strncmp(kind, "saturated", 9) == 0 || strcmp(kind, "sun") == 0);
        uncertain += deviation > UNCERTAIN_LIGHT;
        most = fmax(most, isfinite(deviation) ? deviation : 0.0);
    }
    if (hidden > 0)
        buf_printf(out, "<li>%d source%s of light in no photograph: estimated from lit surfaces alone.</li>", hidden,
                   hidden == 1 ? "" : "s");
    if (saturated > 0)
        buf_printf(out,
                   "<li>%d source%s of light too bright for every photograph: estimated from lit surfaces alone.</li>",
                   saturated, saturated == 1 ? "" : "s");
    if (uncertain > 0)
        buf_printf(out,
                   "<li>The brightness of %d source%s of light is uncertain: the standard deviation is up to "
                   "%.0f %%.</li>",
                   uncertain, uncertain == 1 ? "" : "s", 100.0 * most);
    *reasons += (hidden > 0) + (saturated > 0) + (uncertain > 0);
}

/* Error that lies beside outlines is of poses and mesh, not of materials. */
static void put_outlines(struct buf *out, const cJSON *report, int *reasons) {
    double part = number_at(report, "metrics", "msre_at_outlines") / number_at(report, "metrics", "msre");
    double pixels = number_at(report, "metrics", "outline_share");
    if (!(part > OUTLINE_PART && part > OUTLINE_TIMES * pixels))
        return;
    buf_printf(
        out,
        "<li>%.0f %% of the error lies beside outlines, on %.0f %% of the pixels: mesh and photographs do not meet "
        "there to the pixel.</li>",
        100.0 * fmin(part, 1.0), 100.0 * pixels);
    *reasons += 1;
}

static void put_weak(struct buf *out, const cJSON *report) {
    double seen = number_at(report, "seen_surface_share", NULL);
    double photographs = number_at(report, "prepare", "training_photographs");
    double unseen = number_at(report, "unseen_light", "share_of_rays");
    int reasons = 0;
    buf_puts(out, "<p>Where it is weak:</p><ul>");
    if (cJSON_IsFalse(cJSON_GetObjectItemCaseSensitive(report, "lit"))) {
        buf_puts(out, "<li>Nothing that shines was found: re-renders are black, and base colours mean nothing. Is the "
                      "mesh that of the photographs?</li>");
        reasons++;
    }
    if (seen < SEEN_WHOLE) {
        buf_printf(out, "<li>%.0f %% of the surface is in no photograph: its colour is that of its surroundings.</li>",
                   100.0 * (1.0 - seen));
        reasons++;
    }
    if (photographs < FEW_PHOTOGRAPHS) {
        buf_printf(out, "<li>Few photographs: %.0f. Gloss and noise are told apart by many views of a place.</li>",
                   photographs);
        reasons++;
    }
    const cJSON *calibration = cJSON_GetObjectItemCaseSensitive(report, "calibration");
    if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(calibration, "contrast_unknown"))) {
        buf_puts(out,
                 "<li>The exposures of the photographs are not told: contrast that the camera adds is not seen, and "
                 "makes what is dark too dark. EXIF, or an exposure for each frame, tells it.</li>");
        reasons++;
    }
    if (unseen > UNSEEN_LIGHT) {
        buf_printf(out, "<li>%.0f %% of the light's directions lead to where no photograph looks.</li>",
                   100.0 * unseen);
        reasons++;
    }
    put_outlines(out, report, &reasons);
    put_lights(out, report, &reasons);
    if (reasons == 0 && seen >= SEEN_WHOLE)
        buf_puts(out, "<li>No weakness is known: photographs show all of the surface.</li>");
    else if (reasons == 0)
        buf_puts(out, "<li>Nothing is known of it.</li>");
    buf_puts(out, "</ul>");
}

void report_verdict(struct buf *out, const cJSON *report) {
    buf_puts(out, "<section class=\"card verdict\" aria-label=\"verdict\">");
    put_found(out, report);
    put_holes(out, report);
    put_views(out, report);
    put_weak(out, report);
    buf_puts(out, "</section>");
}
