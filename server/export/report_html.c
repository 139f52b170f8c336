/* report_html.c -- see report_html.h. All text from outside is escaped by html.h. */
#include "server/export/report_html.h"

#include <math.h>
#include <string.h>

#include "server/export/html.h"
#include "server/export/report_curve.h"
#include "server/export/report_figures.h"
#include "server/export/report_verdict.h"

#define SEGMENT_ROWS 60 /* the rest is in report.json */

static const char style[] =
    ":root{color-scheme:light dark;--ink:#1d2229;--soft:#667080;--line:#d9dde3;--page:#f6f7f9;"
    "--card:#fff;--accent:#b4581c}"
    "@media(prefers-color-scheme:dark){:root{--ink:#e6e8eb;--soft:#98a1ad;--line:#353b44;"
    "--page:#15181c;--card:#1d2126;--accent:#f0955a}}"
    "*{box-sizing:border-box}body{margin:0 auto;padding:2.5rem 1.5rem 4rem;max-width:72rem;"
    "background:var(--page);color:var(--ink);font:15px/1.5 system-ui,'DejaVu Sans',sans-serif}"
    "h1{font-size:1.8rem;margin:0}h2{font-size:1.15rem;margin:2.5rem 0 .8rem}"
    "p{margin:.3rem 0 .8rem}.soft,figcaption span,th{color:var(--soft)}"
    ".grid{display:grid;gap:1rem;grid-template-columns:repeat(auto-fill,minmax(min(20rem,100%),1fr))}"
    ".card,figure{margin:0;background:var(--card);border:1px solid var(--line);"
    "border-radius:8px;padding:.8rem}.card{overflow-x:auto}.card:focus-visible{outline:2px solid var(--accent)}"
    "img{display:block;width:100%;height:auto;border-radius:4px;background:#16181b}"
    "figcaption{margin-top:.5rem;font-size:.9rem}figcaption span{display:block;font-size:.82rem}"
    ".wide figure{margin-bottom:1rem}.heads{display:grid;grid-template-columns:repeat(3,1fr);"
    "text-align:center;font-size:.82rem;color:var(--soft);margin-bottom:.3rem}"
    "table{border-collapse:collapse;width:100%;font-size:.87rem;font-variant-numeric:tabular-nums}"
    "a{color:var(--accent)}th,td{text-align:left;padding:.25rem .7rem .25rem 0;border-bottom:1px solid var(--line);"
    "font-weight:400;vertical-align:top;overflow-wrap:break-word}"
    ".files th{white-space:nowrap}tr:last-child>*{border-bottom:0}td.n,th.n{text-align:right}"
    ".swatch{display:inline-block;width:2.2em;height:1em;border-radius:3px;vertical-align:-.12em;"
    "border:1px solid var(--line);margin-right:.4em}"
    ".bar{display:block;height:.6em;margin:.4em 0;border-radius:3px;background:var(--accent)}"
    ".cards{columns:20rem;column-gap:1rem}.cards .card{break-inside:avoid;margin-bottom:1rem}"
    ".card>b{display:block;margin-bottom:.2rem}.list{margin:1rem 0}.list td,.list th{white-space:nowrap}"
    "svg{display:block;width:100%;height:auto}svg text{fill:var(--soft);font-size:11px}"
    "svg path{fill:none;stroke:var(--accent);stroke-width:1.6;vector-effect:non-scaling-stroke}"
    "svg line{stroke:var(--line)}"
    ".verdict{font-size:1.05rem;margin:1rem 0}"
    "@media(max-width:34rem){body{padding:1rem .7rem 3rem}h1{font-size:1.4rem}"
    ".spare{display:none}.tall{max-height:80vh;overflow-y:auto}.tall th,.tall td{padding-right:.4rem}}"
    "@media print{.card,figure{break-inside:avoid}}";

/* --- sections ----------------------------------------------------------------------------- */

static enum status put_textures(struct buf *out, const struct report_page *page, struct error *err) {
    enum status status = STATUS_OK;
    buf_puts(out, "<h2>Textures</h2><div class=grid>");
    for (size_t i = 0; i < page->texture_count && status == STATUS_OK; i++) {
        buf_puts(out, "<figure>");
        status = html_picture(out, page->texture[i].path, page->texture[i].title, err);
        buf_puts(out, "<figcaption>");
        html_text(out, page->texture[i].title);
        if (page->texture[i].caption) {
            buf_puts(out, "<span>");
            html_text(out, page->texture[i].caption);
            buf_puts(out, "</span>");
        }
        buf_puts(out, "</figcaption></figure>");
    }
    buf_puts(out, "</div>");
    return status;
}

static enum status put_comparisons(struct buf *out, const struct report_page *page, struct error *err) {
    if (page->comparison_count == 0)
        return STATUS_OK;
    const cJSON *view = cJSON_GetObjectItemCaseSensitive(page->report, "views");
    view = view ? view->child : NULL;
    enum status status = STATUS_OK;
    buf_puts(out, "<h2>Held-out views</h2><p class=soft>Photographs that the reconstruction never "
                  "saw, beside what its materials and lights give there. One exposure for both. "
                  "Difference: red where the re-render is too bright, blue where it is too dark, "
                  "white where they agree.</p><div class=wide>");
    for (size_t i = 0; i < page->comparison_count && status == STATUS_OK; i++) {
        buf_puts(out, "<figure><div class=heads><span>photograph</span><span>re-render</span>"
                      "<span>difference</span></div>");
        status = html_picture(out, page->comparison[i].path, page->comparison[i].title, err);
        buf_puts(out, "<figcaption>");
        html_text(out, page->comparison[i].title);
        buf_puts(out, "<span>");
        report_view_figures(out, view, true);
        buf_puts(out, "</span>");
        if (view && view->child) {
            buf_puts(out, "<details><summary>more figures</summary><span>");
            report_view_figures(out, view, false);
            buf_puts(out, "</span></details>");
        }
        buf_puts(out, "</figcaption></figure>");
        view = view ? view->next : NULL;
    }
    buf_puts(out, "</div>");
    return status;
}

static void put_curves(struct buf *out, const cJSON *series) {
    size_t before = 0;
    for (const cJSON *one = series ? series->child : NULL; one; one = one->next) {
        if (!cJSON_IsArray(one) || !report_curve_has(one))
            continue;
        if (before++ == 0)
            buf_puts(out, "<h2>Curves</h2><div class=grid>");
        report_curve(out, one->string, one);
    }
    buf_puts(out, before > 0 ? "</div>" : "");
}

static void put_stages(struct buf *out, const cJSON *stages) {
    if (!cJSON_IsArray(stages) || !stages->child)
        return;
    double longest = 0.0, total = 0.0;
    for (const cJSON *stage = stages->child; stage; stage = stage->next) {
        double seconds = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(stage, "seconds"));
        longest = fmax(longest, isfinite(seconds) ? seconds : 0.0);
        total += isfinite(seconds) ? seconds : 0.0;
    }
    buf_puts(out, "<h2>Time by stage</h2>");
    html_card(out, "", "time by stage");
    buf_printf(out, "<p class=soft>%.1f s in all</p><table>", total);
    for (const cJSON *stage = stages->child; stage; stage = stage->next) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(stage, "name"));
        double seconds = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(stage, "seconds"));
        if (!name || !isfinite(seconds))
            continue;
        buf_puts(out, "<tr><th>");
        html_key(out, name);
        buf_printf(out,
                   "</th><td class=n>%.2f s</td><td style=\"width:60%%\"><span class=bar "
                   "style=\"width:%.1f%%\"></span></td></tr>",
                   seconds, longest > 0.0 ? fmax(100.0 * seconds / longest, 0.3) : 0.0);
    }
    buf_puts(out, "</table></div>");
}

/* A swatch of a linear colour; emission is scaled to its brightest channel. */
static void put_swatch(struct buf *out, const cJSON *color) {
    double c[3] = {0.0, 0.0, 0.0}, high = 1.0;
    int i = 0;
    for (const cJSON *v = color ? color->child : NULL; v && i < 3; v = v->next, i++) {
        c[i] = isfinite(v->valuedouble) ? v->valuedouble : 0.0;
        high = fmax(high, c[i]);
    }
    buf_puts(out, "<span class=swatch style=\"background:rgb(");
    for (i = 0; i < 3; i++) {
        double linear = c[i] / high;
        double s = linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1.0 / 2.4) - 0.055;
        buf_printf(out, "%s%.0f", i ? "," : "", 255.0 * fmax(s, 0.0));
    }
    buf_puts(out, ")\"></span>");
    buf_printf(out, "<span class=spare>%.3g %.3g %.3g</span>", c[0], c[1], c[2]);
}

static void put_segment(struct buf *out, const cJSON *segment) {
    static const struct {
        const char *key, *class;
    } plain[] = {{"area_m2", "n"}, {"texels", "\"n spare\""}, {"roughness", "n"}, {"specular", "n"}};
    buf_puts(out, "<tr><td>");
    html_value(out, cJSON_GetObjectItemCaseSensitive(segment, "id"));
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(segment, "name");
    if (name) {
        buf_puts(out, " ");
        html_value(out, name);
    }
    buf_puts(out, "</td>");
    for (size_t i = 0; i < sizeof plain / sizeof *plain; i++) {
        buf_printf(out, "<td class=%s>", plain[i].class);
        html_value(out, cJSON_GetObjectItemCaseSensitive(segment, plain[i].key));
        buf_puts(out, "</td>");
    }
    buf_puts(out, "<td>");
    put_swatch(out, cJSON_GetObjectItemCaseSensitive(segment, "mean_base_color"));
    buf_puts(out, "</td><td>");
    if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(segment, "emitter")))
        put_swatch(out, cJSON_GetObjectItemCaseSensitive(segment, "emission"));
    buf_puts(out, "</td></tr>");
}

/* Emitters first, then the others in their own order. */
static void put_segments(struct buf *out, const cJSON *segments) {
    if (!cJSON_IsArray(segments))
        return;
    int count = cJSON_GetArraySize(segments), emitters = 0, rows = 0;
    for (const cJSON *s = segments->child; s; s = s->next)
        emitters += cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(s, "emitter"));
    buf_puts(out, "<h2>Segments</h2>");
    html_card(out, " tall", "segments");
    buf_printf(out,
               "<p class=soft>%d segments, %d of them "
               "emitters.</p><table><tr><th>object</th><th class=n>area, m²</th><th class=\"n spare\">texels"
               "</th><th class=n>roughness</th><th class=n>specular</th><th>mean base colour</th>"
               "<th>emission, radiance</th></tr>",
               count, emitters);
    for (int pass = 1; pass >= 0; pass--) {
        for (const cJSON *s = segments->child; s && rows < SEGMENT_ROWS; s = s->next) {
            if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(s, "emitter")) != pass)
                continue;
            put_segment(out, s);
            rows++;
        }
    }
    buf_puts(out, "</table>");
    if (rows < count)
        buf_printf(out, "<p class=soft>%d more are in report.json.</p>", count - rows);
    buf_puts(out, "</div>");
}

static void put_files(struct buf *out, const cJSON *files) {
    if (!cJSON_IsArray(files))
        return;
    buf_puts(out, "<h2>Files</h2>");
    html_card(out, " files", "files");
    buf_puts(out, "<table>");
    for (const cJSON *file = files->child; file; file = file->next) {
        const cJSON *name = cJSON_GetObjectItemCaseSensitive(file, "name");
        buf_puts(out, "<tr><th><a href=\"");
        html_value(out, name);
        buf_puts(out, "\">");
        html_value(out, name);
        buf_puts(out, "</a></th><td>");
        html_value(out, cJSON_GetObjectItemCaseSensitive(file, "about"));
        buf_puts(out, "</td></tr>");
    }
    buf_puts(out, "</table></div>");
}

enum status report_html(const struct report_page *page, struct buf *out, struct error *err) {
    const cJSON *report = page->report;
    buf_puts(out, "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport "
                  "content=\"width=device-width,initial-scale=1\"><title>");
    html_text(out, page->title);
    buf_puts(out, " – unbake</title><style>");
    buf_puts(out, style);
    buf_puts(out, "</style><main><h1>");
    html_text(out, page->title);
    buf_puts(out, "</h1><p class=soft>Materials and lights recovered by unbake. Colours are linear "
                  "Rec. 709; radiance is in units in which a frame of exposure 1 maps radiance 1 "
                  "to pixel value 1.</p>");
    report_verdict(out, report);
    enum status status = put_comparisons(out, page, err);
    if (status == STATUS_OK)
        status = put_textures(out, page, err);
    if (status != STATUS_OK)
        return status;
    put_curves(out, cJSON_GetObjectItemCaseSensitive(report, "series"));
    put_segments(out, cJSON_GetObjectItemCaseSensitive(report, "segments"));
    put_stages(out, cJSON_GetObjectItemCaseSensitive(report, "stages"));
    report_figures(out, report);
    put_files(out, cJSON_GetObjectItemCaseSensitive(report, "files"));
    buf_puts(out, "</main></html>\n");
    if (out->overflowed)
        return error_set(err, STATUS_LIMIT, "report.html would be larger than %zu bytes", out->limit);
    return STATUS_OK;
}
