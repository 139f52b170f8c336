/* report_figures.c -- see report_figures.h. */
#include "server/export/report_figures.h"

#include <string.h>

#include "server/export/html.h"

/* --- how near re-renders come --------------------------------------------------------------------- */

struct figure_name {
    const char *key, *name, *good;
};

static const struct figure_name known[] = {
    {"held_out_views", "held-out views", ""},
    {"msre", "mean squared relative error", ", 0 is best"},
    {"msre_noise_left", "give or take, by noise of the re-render", ""},
    {"msre_at_outlines", "of that beside outlines", ""},
    {"outline_share", "share of pixels beside outlines", ""},
    {"msre_render_noise", "that noise, which is not in the error", ""},
    {"msre_photograph_noise", "noise of the photograph, which is", ""},
    {"brightness_error", "by how much whole views are too bright or dark", ", 0 is best"},
    {"psnr_db", "PSNR in dB", ", 25 and more is good"},
    {"psnr_noise_left_db", "give or take", " dB"},
    {"ssim", "SSIM", ", 1 is best"},
    {"samples", "samples a pixel", ""},
};

static struct figure_name figure_name(const char *key) {
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strcmp(known[i].key, key) == 0)
            return known[i];
    return (struct figure_name){key, key, ""};
}

void report_view_figures(struct buf *out, const cJSON *view, bool main) {
    static const char *const chosen[] = {"msre", "psnr_db", "ssim"};
    const char *between = "";
    for (const cJSON *m = view ? view->child : NULL; m; m = m->next) {
        struct figure_name figure = figure_name(m->string ? m->string : "");
        bool is_chosen = false;
        for (size_t i = 0; i < sizeof chosen / sizeof *chosen; i++)
            is_chosen = is_chosen || strcmp(chosen[i], figure.key) == 0;
        if (!cJSON_IsNumber(m) || is_chosen != main)
            continue;
        buf_puts(out, between);
        html_key(out, figure.name);
        buf_puts(out, " ");
        html_number(out, m->valuedouble);
        buf_puts(out, figure.good);
        between = ";&ensp;";
    }
}

static void put_metrics(struct buf *out, const cJSON *metrics) {
    html_card(out, "", metrics->string);
    buf_puts(out, "<b>held-out views, in the mean</b><table>");
    for (const cJSON *m = metrics->child; m; m = m->next) {
        struct figure_name figure = figure_name(m->string);
        buf_puts(out, "<tr><th>");
        html_key(out, figure.name);
        buf_puts(out, "</th><td>");
        html_value(out, m);
        buf_puts(out, figure.good);
        buf_puts(out, "</td></tr>");
    }
    buf_puts(out, "</table></div>");
}

/* --- settings -------------------------------------------------------------------------------------- */

/* Under the names that set them; those that are empty are left out. */
static void put_settings(struct buf *out, const cJSON *settings) {
    html_card(out, "", settings->string);
    buf_puts(out, "<b>settings</b><table>");
    for (const cJSON *member = settings->child; member; member = member->next) {
        if (!html_has(member))
            continue;
        buf_puts(out, "<tr><th>");
        html_text(out, member->string);
        buf_puts(out, "</th><td>");
        html_value(out, member);
        buf_puts(out, "</td></tr>");
    }
    buf_puts(out, "</table></div>");
}

/* --- all others ----------------------------------------------------------------------------------- */

enum kind { PLAIN, CARD, LIST };

/* Vectors are plain: a few numbers. */
static enum kind kind_of(const cJSON *member) {
    if (cJSON_IsObject(member))
        return CARD;
    return cJSON_IsArray(member) && cJSON_IsObject(member->child) ? LIST : PLAIN;
}

static bool is_drawn_elsewhere(const cJSON *member) {
    static const char *const drawn[] = {"title", "series", "stages", "views", "segments", "files"};
    for (size_t i = 0; i < sizeof drawn / sizeof *drawn; i++)
        if (strcmp(member->string, drawn[i]) == 0)
            return true;
    return false;
}

static void put_member(struct buf *out, const cJSON *member, enum kind kind) {
    if (kind == PLAIN) {
        buf_puts(out, "<tr><th>");
        html_key(out, member->string);
        buf_puts(out, "</th><td>");
        html_value(out, member);
        buf_puts(out, "</td></tr>");
    } else if (strcmp(member->string, "metrics") == 0) {
        put_metrics(out, member);
    } else if (strcmp(member->string, "settings") == 0) {
        put_settings(out, member);
    } else {
        html_card(out, kind == LIST ? " list" : "", member->string);
        buf_puts(out, "<b>");
        html_key(out, member->string);
        buf_puts(out, "</b>");
        html_value(out, member);
        buf_puts(out, "</div>");
    }
}

static void put_members(struct buf *out, const cJSON *report, enum kind kind) {
    for (const cJSON *member = report->child; member; member = member->next)
        if (html_has(member) && kind_of(member) == kind && !is_drawn_elsewhere(member))
            put_member(out, member, kind);
}

void report_figures(struct buf *out, const cJSON *report) {
    buf_puts(out, "<h2>Figures and settings</h2><div class=cards>");
    html_card(out, "", "summary");
    buf_puts(out, "<table>");
    put_members(out, report, PLAIN);
    buf_puts(out, "</table></div>");
    put_members(out, report, CARD);
    buf_puts(out, "</div>");
    put_members(out, report, LIST);
}
