/* fit.c -- see fit.h. The constants were chosen on the demo room, redkitchen and the room staircase2. */
#include "server/check/fit.h"

#include "common/mem.h"

/* Standard deviations of the score for wrong poses. Among some 2,000 hypotheses the best wrong one reaches 3.5 by
 * chance. */
#define SIGNIFICANT 6.0 /* +25 %: no verdict */
#define SUSPECTED 3.0   /* +25 %: no verdict */
/* A remedy agrees better by so many standard deviations (consistency_compare), and by this factor: small errors of
 * poses are no misfit. */
#define REMEDY_SURE 5.0  /* +25 %: 4 verdicts of 96 */
#define REMEDY_GAIN 1.15 /* +25 %: no verdict */
/* It is taken without asking where it is also plain. A mesh at a wrong place or scale has walls at about the right
 * distance now and then: with the poses of six rooms moved by 7 m, the best of all hypotheses reached a correlation of
 * .09 to .35, most with a scale of no unit; right ones reach .44 to .91, or .3 where the poses drift. Such a mesh suits
 * some photographs and not others: their lower quartile over the mean is 0 to .3 (once .78), that of right ones .71 to
 * .97. */
#define TAKEN_SURE 8.0               /* +25 %: no verdict */
#define TAKEN_GAIN 1.2               /* +25 %: no verdict */
#define TAKEN_CORRELATION 0.4        /* +25 %: no verdict */
#define TAKEN_CORRELATION_SCALED 0.5 /* with a scale of no unit; +25 %: no verdict */
#define TAKEN_EVENNESS 0.5           /* of EVEN_PHOTOGRAPHS or more; +25 %: no verdict */
#define EVEN_PHOTOGRAPHS 12          /* +25 %: no verdict */
/* Correlation at common points, by the same figures: above it poses and mesh fit, below the other they do not. */
#define CORRELATION_FITS 0.2 /* +25 %: no verdict */
#define CORRELATION_LOW 0.08 /* +25 %: no verdict */
/* Share of rays that meet the mesh: above .75 in rooms that fit, also through windows and where ceilings are
 * missing. */
#define HITS_FEW 0.3  /* +25 %: no verdict */
#define HITS_SOME 0.6 /* +25 %: no verdict */
/* Standard deviations that a fitting room's score (at least EXPECTED_CORRELATION of what is common) would be above
 * wrong poses: below it the pictures cannot tell. */
#define POWER 10.0               /* +25 %: no verdict */
#define EXPECTED_CORRELATION 0.2 /* +25 %: 1 verdict of 96 */
#define DETAIL_MIN 0.15          /* share of the area; +25 %: no verdict */

static void tell(struct fit_result *fit, char *sentence) {
    if (fit->evidence_count < FIT_EVIDENCE_MAX)
        fit->evidence[fit->evidence_count++] = sentence;
    else
        mem_free(sentence);
}

const char *fit_verdict_name(enum fit_verdict verdict) {
    return verdict == FIT_YES ? "yes" : verdict == FIT_NO ? "no" : "doubtful";
}

/* --- sentences --------------------------------------------------------------------------------------- */

static void tell_rays(struct fit_result *fit) {
    const struct photo_agreement *a = &fit->search.given;
    tell(fit,
         mem_printf("%.0f %% of the rays through %zu photographs meet the mesh, %.0f %% of these from behind; %.0f %% "
                    "of the cameras stand within its bounds",
                    100.0 * a->hit_share, a->photograph_count, 100.0 * a->back_share, 100.0 * a->inside_share));
}

static void tell_agreement(struct fit_result *fit) {
    const struct photo_agreement *a = &fit->search.given;
    tell(fit,
         mem_printf("at the %.0f %% of the points that another photograph sees, the photographs correlate by %.2f, "
                    "%.1f standard deviations from pictures of other cameras",
                    100.0 * a->shared_share, a->correlation, a->z));
}

/* --- the verdict --------------------------------------------------------------------------------------- */

static bool is_better(const struct search_result *r, double sure, double gain) {
    return r->sure > sure && r->found.z > SIGNIFICANT && r->found.correlation > CORRELATION_LOW &&
           r->found.score > gain * r->given.score;
}

/* Whether most photographs agree, and not some by chance. */
static bool is_even(const struct search_result *r) {
    return r->found.photograph_count < EVEN_PHOTOGRAPHS || consistency_evenness(&r->found) > TAKEN_EVENNESS;
}

/* A scale of no unit is a free parameter by which some photographs can be made to agree in any room, also where the
 * mesh lies elsewhere: with it most of them must. (Evenness .8 and above where it is right, .2 where it is not.) */
static bool has_remedy(const struct search_result *r) {
    return is_better(r, REMEDY_SURE, REMEDY_GAIN) && (search_is_unit_scale(r->best.scale) || is_even(r));
}

/* Whether the better hypothesis is so plainly right that nobody need be asked. */
static bool is_plain(const struct search_result *r) {
    double least = search_is_unit_scale(r->best.scale) ? TAKEN_CORRELATION : TAKEN_CORRELATION_SCALED;
    return is_better(r, TAKEN_SURE, TAKEN_GAIN) && is_even(r) && r->found.correlation > least;
}

/* Without a remedy, and where the photographs do not agree. */
static void judge_disagreement(struct fit_result *fit) {
    const struct photo_agreement *a = &fit->search.given;
    double expected = a->null_deviation > 0.0 ? EXPECTED_CORRELATION * a->shared_share / a->null_deviation : 0.0;
    bool agrees_in_part = a->z > SUSPECTED && a->correlation > CORRELATION_FITS;
    if (a->hit_share < HITS_FEW && agrees_in_part) {
        tell(fit, mem_printf("most rays miss the mesh, but the photographs seem to agree where they meet it: it may be "
                             "incomplete"));
    } else if (a->hit_share < HITS_FEW) {
        fit->verdict = FIT_NO;
        char *others =
            fit->search.tried == 0
                ? mem_strdup("")
                : mem_printf(", and no other axes, scale or order of the frames that were tried (%zu) mend it",
                             fit->search.tried);
        tell(fit, mem_printf("most rays miss the mesh%s: the poses may be of another place or origin", others));
        mem_free(others);
    } else if (fit->detail < DETAIL_MIN) {
        tell(fit,
             mem_printf("only %.0f %% of the photographs' area shows detail: whether they agree cannot be determined",
                        100.0 * fit->detail));
    } else if (expected < POWER) {
        tell(
            fit,
            mem_printf(
                "the photographs, and the points that they have in common, are too few: whether they agree cannot be determined"));
    } else {
        fit->verdict = FIT_NO;
        tell(fit, mem_printf("the photographs show detail and see common points, but do not agree about them, and no "
                             "other axes, scale or order of the frames that were tried (%zu) mend it",
                             fit->search.tried));
    }
}

/* Whether the mesh would agree better elsewhere. */
static bool is_displaced(const struct search_result *r) {
    return vec3_length(r->offset) > 0.0f && r->moved.score > REMEDY_GAIN * r->given.score &&
           consistency_compare(&r->moved, &r->given) > REMEDY_SURE;
}

static void judge_agreement(struct fit_result *fit) {
    const struct photo_agreement *a = &fit->search.given;
    const vec3 offset = fit->search.offset;
    if (is_displaced(&fit->search))
        tell(fit, mem_printf("they would correlate by %.2f were the mesh moved by (%.3g, %.3g, %.3g): mesh and cameras "
                             "may have different origins",
                             fit->search.moved.correlation, (double)offset.x, (double)offset.y, (double)offset.z));
    else if (!fit->search.given_has_parallax)
        tell(fit, mem_printf("they agree as well were the mesh larger or smaller: whether its size is right cannot be "
                             "determined"));
    else if (a->correlation < CORRELATION_FITS)
        tell(fit, mem_printf("they agree, but less than those of a room that fits: poses may be inaccurate"));
    else if (a->hit_share < HITS_SOME)
        tell(fit, mem_printf("many rays miss the mesh: it may be incomplete"));
    else
        fit->verdict = FIT_YES;
}

static void judge(struct fit_result *fit) {
    const struct search_result *r = &fit->search;
    fit->verdict = FIT_DOUBTFUL;
    fit->has_remedy = has_remedy(r);
    fit->is_overwhelming = fit->has_remedy && is_plain(r);
    if (fit->has_remedy) {
        fit->verdict = FIT_NO;
        tell(fit, mem_printf("read in another way, they correlate by %.2f at %.0f %% of the points, which is better by "
                             "%.1f standard deviations%s",
                             r->found.correlation, 100.0 * r->found.shared_share, r->sure,
                             fit->is_overwhelming ? "" : "; this is not beyond doubt: look at the overlays"));
    } else if (r->given.z > SIGNIFICANT && r->given.correlation > CORRELATION_LOW) {
        judge_agreement(fit);
    } else {
        judge_disagreement(fit);
    }
}

void fit_judge(struct fit_result *fit, const struct scene *scene, const struct accel *accel, struct parallel *pool) {
    struct consistency *c = consistency_new(scene, accel, pool);
    *fit = (struct fit_result){.detail = consistency_detail(c)};
    fit->brightness = mem_array(scene->photograph_count + 1, sizeof *fit->brightness);
    for (size_t i = 0; i < scene->photograph_count; i++)
        fit->brightness[i] = consistency_thumbnail(c, i)->brightness;
    search_run(c, scene, &fit->search);
    tell_rays(fit);
    tell_agreement(fit);
    judge(fit);
    consistency_free(c);
}

void fit_release(struct fit_result *fit) {
    for (size_t i = 0; i < fit->evidence_count; i++)
        mem_free(fit->evidence[i]);
    mem_free(fit->brightness);
    *fit = (struct fit_result){0};
}

/* --- for the facts ---------------------------------------------------------------------------------------- */

cJSON *fit_json(const struct fit_result *fit, const struct reading *loaded) {
    cJSON *json = cJSON_CreateObject(), *evidence = cJSON_AddArrayToObject(json, "evidence");
    const struct search_result *r = &fit->search;
    json_add_string(json, "verdict", fit_verdict_name(fit->verdict));
    for (size_t i = 0; i < fit->evidence_count; i++)
        cJSON_AddItemToArray(evidence, json_new_string(fit->evidence[i]));
    struct reading reading = hypothesis_reading(&r->best, loaded);
    char *text = fit->has_remedy ? hypothesis_text(&r->best, loaded) : NULL;
    json_add(json, "remedy", fit->has_remedy ? reading_json(&reading) : cJSON_CreateNull());
    json_add_string(json, "remedy_text", text);
    json_add_number(json, "correlation", r->given.correlation);
    json_add_number(json, "deviations", r->given.z);
    json_add_number(json, "hit_share", r->given.hit_share);
    json_add_number(json, "back_share", r->given.back_share);
    json_add_number(json, "common_share", r->given.shared_share);
    json_add_number(json, "detail_share", fit->detail);
    reading_release(&reading);
    mem_free(text);
    return json;
}
