/* height_fit.c -- see height_fit.h. */
#include "server/scene/height_fit.h"

#include <math.h>
#include <string.h>

#include "common/cholesky.h"

void height_frame_init(struct height_frame *f, vec3 normal, const vec3 *position, const uint32_t *vertex,
                       size_t count) {
    vec3 first = position[vertex[0]];
    double sum[3] = {0.0, 0.0, 0.0}, n = (double)count;
    for (size_t i = 0; i < count; i++) {
        vec3 from = vec3_sub(position[vertex[i]], first);
        sum[0] += (double)from.x;
        sum[1] += (double)from.y;
        sum[2] += (double)from.z;
    }
    f->centre = vec3_add(first, vec3_make((float)(sum[0] / n), (float)(sum[1] / n), (float)(sum[2] / n)));
    double residual_squares = 0.0;
    for (size_t i = 0; i < count; i++) {
        vec3 from = vec3_sub(position[vertex[i]], f->centre);
        residual_squares += (double)vec3_dot(from, from);
    }
    f->unit = sqrt(residual_squares / n) + 1e-9;
    f->normal = vec3_normalize(normal);
    vec3_frame(f->normal, &f->u, &f->v);
}

static void terms_at(const struct height_frame *f, vec3 at, double term[HEIGHT_PARABOLOID]) {
    vec3 from = vec3_sub(at, f->centre);
    double x = (double)vec3_dot(f->u, from) / f->unit, y = (double)vec3_dot(f->v, from) / f->unit;
    term[0] = 1.0;
    term[1] = x;
    term[2] = y;
    term[3] = x * x;
    term[4] = x * y;
    term[5] = y * y;
}

double height_fitted(const struct height_fit *fit, const struct height_frame *f, vec3 at) {
    double term[HEIGHT_PARABOLOID], sum = 0.0;
    terms_at(f, at, term);
    for (size_t k = 0; k < fit->terms; k++)
        sum += fit->coefficient[k] * term[k];
    return sum;
}

double height_variance(const struct height_fit *fit, const struct height_frame *f, vec3 at) {
    double term[HEIGHT_PARABOLOID], solved[HEIGHT_PARABOLOID], sum = 0.0;
    terms_at(f, at, term);
    memcpy(solved, term, sizeof solved);
    cholesky_solve(fit->terms, HEIGHT_PARABOLOID, &fit->factor[0][0], solved);
    for (size_t k = 0; k < fit->terms; k++)
        sum += term[k] * solved[k];
    return sum;
}

bool height_fit(struct height_fit *fit, size_t terms, const struct height_frame *f, const vec3 *position,
                const uint32_t *vertex, size_t count) {
    double term[HEIGHT_PARABOLOID];
    memset(fit, 0, sizeof *fit);
    fit->terms = terms;
    for (size_t i = 0; i < count; i++) {
        vec3 at = position[vertex[i]];
        terms_at(f, at, term);
        for (size_t r = 0; r < terms; r++) {
            fit->coefficient[r] += height_over(f, at) * term[r];
            for (size_t c = 0; c <= r; c++)
                fit->factor[r][c] += term[r] * term[c];
        }
    }
    if (count <= terms || !cholesky_factor(terms, HEIGHT_PARABOLOID, &fit->factor[0][0]))
        return false;
    cholesky_solve(terms, HEIGHT_PARABOLOID, &fit->factor[0][0], fit->coefficient);
    for (size_t i = 0; i < count; i++) {
        vec3 at = position[vertex[i]];
        double off = height_over(f, at) - height_fitted(fit, f, at);
        fit->residual_squares += off * off;
    }
    return true;
}
