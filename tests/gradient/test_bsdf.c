/* bsdf_backward against central differences of bsdf_eval, over random parameters and directions. */
#include "common/rng.h"
#include "server/render/bsdf.h"
#include "tests/check.h"

static float number(int trial, int k) { return rng_to_float((uint32_t)rng_key(5, (uint64_t)trial, (uint64_t)k)); }

static vec3 direction(int trial, int k) {
    float z = 0.05f + 0.95f * number(trial, k), turn = 6.2831853f * number(trial, k + 1);
    float r = sqrtf(1.0f - z * z);
    return (vec3){r * cosf(turn), r * sinf(turn), z};
}

static struct bsdf_value eval(float roughness, float specular, vec3 wo, vec3 wi) {
    struct bsdf b = bsdf_make(rgb_gray(0.5f), roughness, specular, wo.z);
    return bsdf_eval(&b, wo, wi);
}

/* Fourth-order central difference of one lobe by one parameter, and how far it may be off: two step
 * sizes must agree for it to mean anything. */
static double slope(bool by_roughness, bool diffuse, float roughness, float specular, vec3 wo, vec3 wi, float h) {
    double at[4];
    const float step[4] = {-2.0f * h, -h, h, 2.0f * h};
    float exact[4];
    for (int i = 0; i < 4; i++) {
        volatile float moved = (by_roughness ? roughness : specular) + step[i];
        exact[i] = moved;
        struct bsdf_value v = by_roughness ? eval(moved, specular, wo, wi) : eval(roughness, moved, wo, wi);
        at[i] = (double)(diffuse ? v.diffuse : v.specular);
    }
    double width = (double)(exact[2] - exact[1]);
    return (8.0 * (at[2] - at[1]) - (at[3] - at[0])) / (6.0 * width);
}

static void check_slope(const char *what, double found, bool by_roughness, bool diffuse, float roughness,
                        float specular, vec3 wo, vec3 wi, int trial) {
    double wanted = slope(by_roughness, diffuse, roughness, specular, wo, wi, 4e-3f);
    double finer = slope(by_roughness, diffuse, roughness, specular, wo, wi, 2e-3f);
    struct bsdf_value v = eval(roughness, specular, wo, wi);
    double size = (double)fabsf(diffuse ? v.diffuse : v.specular);
    double tolerance = 3.0 * fabs(wanted - finer) + 2e-3 * fabs(wanted) + 3e-4 * size + 1e-6;
    CHECK_THAT(fabs(found - finer) <= tolerance, "trial %d: %s is %.6g, differences say %.6g +- %.2g", trial, what,
               found, finer, tolerance);
}

int main(void) {
    for (int trial = 0; trial < 20000; trial++) {
        vec3 wo = direction(trial, 0), wi = direction(trial, 2);
        if (trial % 2) /* near the mirror direction, where the lobe is */
            wi = vec3_normalize(
                (vec3){-wo.x + 0.1f * (number(trial, 4) - 0.5f), -wo.y + 0.1f * (number(trial, 5) - 0.5f), wo.z});
        float roughness = 0.1f + 0.85f * number(trial, 6), specular = 0.02f + 0.95f * number(trial, 7);
        struct bsdf b = bsdf_make(rgb_gray(0.5f), roughness, specular, wo.z);
        struct bsdf_derivative d = bsdf_backward(&b, specular, wo, wi);
        struct bsdf_value v = bsdf_eval(&b, wo, wi);
        CHECK_NEAR(d.diffuse, v.diffuse, 1e-6f * (1.0f + v.diffuse));
        check_slope("diffuse by roughness", (double)d.diffuse_by_roughness, true, true, roughness, specular, wo, wi,
                    trial);
        check_slope("specular by roughness", (double)d.specular_by_roughness, true, false, roughness, specular, wo, wi,
                    trial);
        check_slope("specular by specular", (double)d.specular_by_specular, false, false, roughness, specular, wo, wi,
                    trial);
    }
    /* Where the lobe vanishes, its derivative is that of a lobe that just appears. */
    vec3 wo = {0.6f, 0.0f, 0.8f}, wi = {-0.6f, 0.0f, 0.8f};
    struct bsdf none = bsdf_make(rgb_gray(0.5f), 0.5f, 0.0f, wo.z);
    CHECK(bsdf_eval(&none, wo, wi).specular == 0.0f);
    double wanted = (double)eval(0.5f, 2e-3f, wo, wi).specular / 2e-3;
    CHECK_NEAR(bsdf_backward(&none, 0.0f, wo, wi).specular_by_specular, wanted, 0.02 * wanted);
    /* Narrower than the narrowest lobe: roughness moves nothing but retro-reflection. */
    struct bsdf narrow = bsdf_make(rgb_gray(0.5f), 0.02f, 0.5f, wo.z);
    CHECK(bsdf_backward(&narrow, 0.5f, wo, wi).specular_by_roughness == 0.0f);
    /* Below the horizon nothing is reflected and nothing has a derivative. */
    vec3 under = {0.6f, 0.0f, -0.8f};
    struct bsdf_derivative d = bsdf_backward(&narrow, 0.5f, wo, under);
    CHECK(d.diffuse == 0.0f && d.specular_by_specular == 0.0f && d.diffuse_by_roughness == 0.0f);
    return check_result();
}
