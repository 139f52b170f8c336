/* joint_fit.h -- joint estimate of the radiance of all light sources from points of the surface that they light.
 *
 * Point i, of segment s and patch p, reflects the known light E_i and that of the sources, x_j = exp(theta_j):
 *
 *     b_i = log O_i - log(E_i + sum_j R_ij x_j) = mu_s + eta_p + epsilon_i
 *
 *     O_i         observed outgoing radiance, without highlights where they are known
 *     E_i, R_ij   what a surface of albedo 1 would send of known light, and of source j at radiance 1
 *     mu_s        log albedo of the segment, normal about ALBEDO_MEAN
 *     eta_p       error of the model in a patch: texture and light that is not modelled, Student's t
 *     epsilon_i   texture, noise and highlights at the point, Student's t
 *
 * and the mean of a patch hardly exceeds that of white paint, which is normal about ALBEDO_WHITE: all errors of E_i
 * have a common part. Patches make neighbouring points count as what they are: not
 * independent. The maximum of the posterior in theta, with mu and eta at their best, is found by Gauss-Newton steps
 * with iterative reweighting; mu and eta are eliminated by Schur complements. Its curvature gives the sources'
 * variances.
 *
 * Of a point that saturates in all photographs O_i is a lower bound: it takes part with the probability that its b_i
 * exceeds that (Tobin 1958).
 *
 * Lange, Little and Taylor 1989 (Student's t by reweighting). */
#ifndef UNBAKE_LIGHT_JOINT_FIT_H
#define UNBAKE_LIGHT_JOINT_FIT_H

#include "server/light/joint_model.h"

/* Borrows the points; no sources yet but white paint. There may be `source_max`. */
void joint_fit_init(struct joint_fit *f, const struct joint_point *point, size_t point_count, size_t source_max,
                    struct parallel *pool);
void joint_fit_release(struct joint_fit *f);

/* Appends a source; `column` is its column of R. Its value is to be set, at least `least`. */
void joint_fit_add(struct joint_fit *f, const struct joint_source *source, const float *column);
/* Removes the source that was added last. It must not be tied. */
void joint_fit_remove_last(struct joint_fit *f);

/* Negative logarithm of the posterior at the sources' values, up to a constant. */
double joint_fit_loss(const struct joint_fit *f);

/* Moves the sources' values to a maximum of the posterior; returns joint_fit_loss there. */
double joint_fit_solve(struct joint_fit *f);

/* Sets the sources' errors and what they come to together: the curvature at their values. */
void joint_fit_errors(struct joint_fit *f);

/* A further source of that column of R: sets its value to the best one, the others' being what they are, and returns by
 * how much the loss falls; 0 where no value helps. May run on several threads at once. */
double joint_fit_try(const struct joint_fit *f, struct joint_source *source, const float *column);

#endif
