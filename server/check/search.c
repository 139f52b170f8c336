/* search.c -- see search.h. */
#include "server/check/search.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Points of all photographs together in a full measurement: few photographs have more each. */
#define FULL_POINTS 7680 /* +25 %: no verdict */
static const struct consistency_effort screening = {16, 48, 0}, refining = {24, 96, 0};

/* Of the points: those by which hypotheses are chosen are not those by which they are judged. */
#define SCREENING_SEED 1
#define REFINING_SEED 2
#define FULL_SEED 3
#define KEPT 4 /* of the screened hypotheses, to be measured in full; to 5: no verdict */
/* Of scales: the score falls by a third at 5 % in the rooms that it was measured on. */
#define GRID_STEP 1.12 /* +25 %: no verdict */
#define ROUNDS 3       /* of changing one thing at a time; to 4: no verdict */
#define AGREES 0.12 /* score above which poses are near the right ones: wrong ones stay below .05; +25 %: no verdict */
/* Of the best score so far, at low effort: below it nothing is measured in full. */
#define PROMISING 0.6 /* +25 %: no verdict */
/* The score must fall by this factor where the mesh is larger or smaller by PARALLAX_STEP: turns alone make distant
 * things agree, whatever their distance. Right scales fall to .2 to .45. */
#define PARALLAX_FALL 0.7  /* +25 %: no verdict */
#define PARALLAX_STEP 1.3  /* +25 %: 1 verdict of 96 */
#define SURE 3.0           /* standard errors by which another hypothesis is taken up; +25 %: no verdict */
#define OFFSET_ROUNDS 2    /* of all directions, at each length of step; to 3: no verdict */
#define OFFSET_GAIN 1.02   /* of a step: less is chance; +25 %: no verdict */
#define SNAP 0.015         /* relative distance at which a scale is that of a unit; +25 %: no verdict */
#define NEAR_DIAGONALS 2.0 /* of the mesh's: cameras farther from its centre cannot see a room; +25 %: no verdict */
#define SPREAD_MIN 0.004   /* of the cameras, in diagonals of the mesh: a walk of 4 cm in 10 m; +25 %: no verdict */

static const double unit_scales[] = {1e-3,         1e-2, 0.0254,       0.1,   0.3048, 1.0,
                                     1.0 / 0.3048, 10.0, 1.0 / 0.0254, 100.0, 1e3};
#define UNIT_COUNT (sizeof unit_scales / sizeof *unit_scales)

struct candidate {
    struct hypothesis hypothesis;
    double score;
};

struct state {
    const struct consistency *c;
    const struct scene *scene;
    struct consistency_effort full;
    size_t tried;
    struct candidate kept[KEPT]; /* best first */
    size_t kept_count;
    double centre[3], diagonal; /* of the mesh */
    double screened;            /* score of the best so far, at low effort */
    bool is_distorted;          /* a lens is not that of a pinhole */
    double spread;              /* diagonal of the cameras' bounds */
};

/* --- candidates ------------------------------------------------------------------------------------ */

/* Whether the cameras stand where they could see the mesh. */
static bool is_plausible(const struct state *s, const struct hypothesis *h) {
    double spread = s->spread / h->scale;
    size_t close = 0, posed = 0;
    if (spread < SPREAD_MIN * s->diagonal && h->scale != 1.0)
        return false;
    for (size_t i = 0; i < s->scene->photograph_count; i += 1 + s->scene->photograph_count / 32) {
        struct camera camera;
        if (!hypothesis_camera(h, s->scene, i, &camera))
            continue;
        vec3 o = camera_origin(&camera);
        double dx = (double)o.x - s->centre[0], dy = (double)o.y - s->centre[1], dz = (double)o.z - s->centre[2];
        posed++;
        close += sqrt(dx * dx + dy * dy + dz * dz) < NEAR_DIAGONALS * s->diagonal;
    }
    return 2 * close >= posed;
}

static void try(struct state *s, const struct hypothesis *h) {
    struct photo_agreement a;
    if (hypothesis_is_given(h) || !is_plausible(s, h))
        return;
    consistency_measure(s->c, h, &screening, SCREENING_SEED, &a);
    s->tried++;
    size_t at = s->kept_count;
    while (at > 0 && s->kept[at - 1].score < a.score)
        at--;
    if (at == KEPT)
        return;
    s->kept_count += s->kept_count < KEPT;
    for (size_t i = s->kept_count - 1; i > at; i--)
        s->kept[i] = s->kept[i - 1];
    s->kept[at] = (struct candidate){*h, a.score};
}

static void try_scales(struct state *s, const struct hypothesis *from) {
    struct hypothesis h = *from;
    for (size_t i = 0; i < UNIT_COUNT; i++) {
        h.scale = from->scale * unit_scales[i];
        try(s, &h);
    }
    /* From cameras that fill two diagonals of the mesh to cameras in a small part of it. */
    double low = s->spread / (2.0 * s->diagonal), high = s->spread / (0.02 * s->diagonal);
    for (double scale = low; s->spread > 0.0 && scale < high; scale *= GRID_STEP) {
        h.scale = scale;
        try(s, &h);
    }
}

/* One thing at a time is changed. */
static void try_neighbours(struct state *s, const struct hypothesis *from) {
    static const double lenses[] = {0.25, 0.5, 2.0, 4.0};
    struct hypothesis h = *from;
    for (int axes = AXES_OPENCV; axes <= AXES_OPENGL_INVERSE; axes++) {
        h.axes = (enum matrix_axes)axes == s->scene->pose_axes ? AXES_OF_FORMAT : (enum matrix_axes)axes;
        try(s, &h);
    }
    h = *from;
    for (int i = 0; i < 48; i++) {
        h.mesh_axes = hypothesis_signed_axes(i);
        try(s, &h);
    }
    h = *from;
    for (size_t i = 0; i < s->scene->other_count; i++) {
        h.coordinates = s->scene->other[i];
        try(s, &h);
    }
    h = *from;
    for (int shift = -3; shift <= 3; shift++) {
        h.shift = shift;
        if ((size_t)(shift < 0 ? -shift : shift) + 2 <= s->scene->photograph_count)
            try(s, &h);
    }
    h = *from;
    for (size_t i = 0; i < sizeof lenses / sizeof *lenses; i++) {
        h.lens = lenses[i];
        try(s, &h);
    }
    h = *from;
    h.is_pinhole = s->is_distorted;
    try(s, &h);
    try_scales(s, from);
}

/* Meanings of the matrices, axes and units of the mesh together. */
static void try_combinations(struct state *s) {
    struct hypothesis h = hypothesis_given();
    for (int axes = AXES_OPENCV; axes <= AXES_OPENGL_INVERSE; axes++) {
        h.axes = (enum matrix_axes)axes == s->scene->pose_axes ? AXES_OF_FORMAT : (enum matrix_axes)axes;
        for (int i = 0; i < 48; i++)
            for (size_t k = 0; k < UNIT_COUNT; k++)
                for (int pinhole = 0; pinhole <= s->is_distorted; pinhole++) {
                    h.mesh_axes = hypothesis_signed_axes(i);
                    h.scale = unit_scales[k];
                    h.is_pinhole = pinhole;
                    try(s, &h);
                }
    }
}

static void try_turned_scales(struct state *s) {
    struct hypothesis h = hypothesis_given();
    for (int i = 1; i < 24; i++) {
        h.mesh_axes = hypothesis_signed_axes(i);
        try_scales(s, &h);
    }
}

/* --- the best -------------------------------------------------------------------------------------------- */

static double refined_score(const struct state *s, const struct hypothesis *h) {
    struct photo_agreement a;
    consistency_measure(s->c, h, &refining, REFINING_SEED, &a);
    return a.score;
}

/* Improves a scale that is no unit's, and takes a unit's where it is close to one. */
static void refine_scale(const struct state *s, struct hypothesis *h) {
    if (h->scale == 1.0)
        return;
    double best = refined_score(s, h);
    for (double step = 0.06; step > 0.002; step /= 2.0)
        for (int side = -1; side <= 1; side += 2) {
            struct hypothesis moved = *h;
            moved.scale *= 1.0 + side * step;
            double score = refined_score(s, &moved);
            if (score > best) {
                best = score;
                *h = moved;
            }
        }
    char digits[32];
    snprintf(digits, sizeof digits, "%.3g", h->scale);
    h->scale = strtod(digits, NULL);
    for (size_t i = 0; i < UNIT_COUNT; i++)
        if (fabs(h->scale / unit_scales[i] - 1.0) < SNAP)
            h->scale = unit_scales[i];
}

/* Whether the agreement depends on the distances of the surface. */
static bool has_parallax(const struct state *s, const struct hypothesis *h, const struct photo_agreement *a) {
    for (int side = 0; side < 2; side++) {
        struct hypothesis moved = *h;
        struct photo_agreement other;
        struct consistency_effort effort = {s->full.photographs, s->full.points, 0};
        moved.scale *= side ? PARALLAX_STEP : 1.0 / PARALLAX_STEP;
        consistency_measure(s->c, &moved, &effort, FULL_SEED, &other);
        if (other.score > PARALLAX_FALL * a->score || consistency_compare(a, &other) < SURE)
            return false;
    }
    return true;
}

/* Measures the promising of what was kept in full and takes the best of it, if it is better than the best so far. */
static bool settle(struct state *s, struct search_result *r) {
    bool improved = false;
    double screened = s->screened;
    for (size_t i = 0; i < s->kept_count; i++) {
        struct hypothesis h = s->kept[i].hypothesis;
        struct photo_agreement a;
        if (!(s->kept[i].score > PROMISING * screened))
            break;
        refine_scale(s, &h);
        consistency_measure(s->c, &h, &s->full, FULL_SEED, &a);
        if (!(a.score > r->found.score) || consistency_compare(&a, &r->found) < SURE || !has_parallax(s, &h, &a))
            continue;
        r->found = a;
        r->best = h;
        s->screened = s->kept[i].score;
        improved = true;
    }
    s->kept_count = 0;
    return improved;
}

/* Moves the mesh of the given hypothesis uphill, by steps from a sixteenth of its diagonal on. */
static void find_offset(const struct state *s, struct search_result *r) {
    struct hypothesis h = hypothesis_given();
    double best = refined_score(s, &h);
    for (double step = s->diagonal / 16.0; step > s->diagonal / 300.0; step /= 2.0)
        for (int direction = 0; direction < 6 * OFFSET_ROUNDS; direction++) {
            struct hypothesis trial = h;
            float *component = direction % 3 == 0   ? &trial.offset.x
                               : direction % 3 == 1 ? &trial.offset.y
                                                    : &trial.offset.z;
            *component += (float)(direction % 6 < 3 ? step : -step);
            double score = refined_score(s, &trial);
            if (score > OFFSET_GAIN * best) {
                best = score;
                h = trial;
            }
        }
    consistency_measure(s->c, &h, &s->full, FULL_SEED, &r->moved);
    if (consistency_compare(&r->moved, &r->given) > SURE)
        r->offset = h.offset;
}

static void measure_extent(struct state *s) {
    vec3 lower, upper, first = {INFINITY, INFINITY, INFINITY}, last = {-INFINITY, -INFINITY, -INFINITY};
    mesh_bounds(&s->scene->mesh, &lower, &upper);
    vec3 centre = vec3_scale(vec3_add(lower, upper), 0.5f);
    s->centre[0] = (double)centre.x;
    s->centre[1] = (double)centre.y;
    s->centre[2] = (double)centre.z;
    s->diagonal = (double)vec3_length(vec3_sub(upper, lower));
    for (size_t i = 0; i < s->scene->photograph_count; i++) {
        vec3 o = camera_origin(&s->scene->photograph[i].camera);
        first = vec3_make(fminf(first.x, o.x), fminf(first.y, o.y), fminf(first.z, o.z));
        last = vec3_make(fmaxf(last.x, o.x), fmaxf(last.y, o.y), fmaxf(last.z, o.z));
        s->is_distorted = s->is_distorted || camera_is_distorted(&s->scene->photograph[i].camera);
    }
    s->spread = (double)vec3_length(vec3_sub(last, first));
}

bool search_is_unit_scale(double scale) {
    for (size_t i = 0; i < UNIT_COUNT; i++)
        if (scale == unit_scales[i])
            return true;
    return false;
}

void search_run(const struct consistency *c, const struct scene *scene, struct search_result *result) {
    size_t count =
        scene->photograph_count < CONSISTENCY_PHOTOGRAPHS ? scene->photograph_count : CONSISTENCY_PHOTOGRAPHS;
    struct state s = {.c = c, .scene = scene};
    struct search_result *r = result;
    struct photo_agreement screened;
    s.full = (struct consistency_effort){count, FULL_POINTS / count, 32};
    if (s.full.points > CONSISTENCY_POINTS)
        s.full.points = CONSISTENCY_POINTS;
    measure_extent(&s);
    *r = (struct search_result){.best = hypothesis_given()};
    consistency_measure(c, &r->best, &s.full, FULL_SEED, &r->given);
    r->found = r->given;
    consistency_measure(c, &r->best, &screening, SCREENING_SEED, &screened);
    s.screened = screened.score;
    r->given_has_parallax = has_parallax(&s, &r->best, &r->given);
    for (int round = 0; round < ROUNDS; round++) {
        try_neighbours(&s, &r->best);
        if (!settle(&s, r))
            break;
    }
    if (r->found.score < AGREES) {
        try_combinations(&s);
        settle(&s, r);
    }
    if (r->found.score < AGREES) {
        try_turned_scales(&s);
        settle(&s, r);
    }
    if (hypothesis_is_given(&r->best) && r->given.score > AGREES)
        find_offset(&s, r);
    r->tried = s.tried;
    r->sure = hypothesis_is_given(&r->best) ? 0.0 : consistency_compare(&r->found, &r->given);
}
