/* joint_alike.c -- see joint_alike.h. */
#include "server/light/joint_alike.h"

#include <math.h>

#include "common/mem.h"

struct alike {
    const struct joint_fit *f;
    float radius_m;
    vec3 *middle;  /* [patch_count] of the patches */
    double *score; /* [patch_count] weighted derivative of the loss by the patch's offset, for its prior's part */
    double products, squares;
};

static void find_middles(struct alike *a, const vec3 *position) {
    const struct joint_fit *f = a->f;
    for (size_t p = 0; p < f->patch_count; p++) {
        vec3 sum = {0.0f, 0.0f, 0.0f};
        for (size_t i = f->patch[p]; i < f->patch[p + 1]; i++)
            sum = vec3_add(sum, position[i]);
        a->middle[p] = vec3_scale(sum, 1.0f / (float)(f->patch[p + 1] - f->patch[p]));
    }
}

static void add_block(struct alike *a, const struct joint_block *b) {
    float reach = a->radius_m * a->radius_m;
    for (size_t p = b->first_patch; p < b->end_patch; p++) {
        a->squares += a->score[p] * a->score[p];
        for (size_t q = b->first_patch; q < b->end_patch; q++) {
            vec3 way = vec3_sub(a->middle[p], a->middle[q]);
            a->products += vec3_dot(way, way) < reach ? a->score[p] * a->score[q] : 0.0;
        }
    }
}

/* A source's share of the light of a patch. */
static double share_of(const struct joint_fit *f, size_t patch, size_t source, const double *x) {
    double share = 0.0;
    for (size_t i = f->patch[patch]; i < f->patch[patch + 1]; i++)
        share += (double)f->response[i * f->source_max + source] * x[source] / joint_fit_light(f, i, x);
    return share / (double)(f->patch[patch + 1] - f->patch[patch]);
}

double joint_alike(const struct joint_fit *f, const vec3 *position, float radius_m, size_t source) {
    struct alike a = {.f = f, .radius_m = radius_m};
    struct joint_scratch s;
    double *x = joint_fit_radiances(f);
    a.middle = mem_array(f->patch_count + 1, sizeof *a.middle);
    a.score = mem_array(f->patch_count + 1, sizeof *a.score);
    joint_scratch_init(&s, f);
    find_middles(&a, position);
    for (size_t k = 0; k < f->block_count; k++) {
        const struct joint_block *b = &f->block[k];
        joint_find_base(f, b, x, &s);
        joint_settle(f, b, &s);
        for (size_t p = b->first_patch; p < b->end_patch; p++)
            a.score[p] = s.stiffness[p - b->first_patch] * s.offset[p - b->first_patch] *
                         (source == JOINT_ALIKE_ALL ? 1.0 : share_of(f, p, source, x));
        add_block(&a, b);
    }
    joint_scratch_release(&s);
    mem_free(a.score);
    mem_free(a.middle);
    mem_free(x);
    return a.squares > 0.0 ? fmax(a.products / a.squares, 1.0) : 1.0;
}
