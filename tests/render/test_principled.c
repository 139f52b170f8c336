/* The reflection model against Mitsuba 3's `principled`: values and directional albedo. */
#include "common/rng.h"
#include "server/render/bsdf.h"
#include "tests/check.h"

#define ALBEDO_SAMPLES 65536

static void check_values(void) {
    FILE *file = fopen(check_data("conformance/principled.csv"), "r");
    char line[512];
    CHECK(file && fgets(line, sizeof line, file));
    int rows = 0;
    double worst = 0.0;
    while (fgets(line, sizeof line, file)) {
        float r, g, b, roughness, specular, f[3];
        vec3 wi, wo; /* theirs: wi is the viewer's */
        int n = sscanf(line, "%f,%f,%f,%f,%f,%f,%f,%f,%f,%f,%f,%f,%f,%f", &r, &g, &b, &roughness, &specular, &wi.x,
                       &wi.y, &wi.z, &wo.x, &wo.y, &wo.z, &f[0], &f[1], &f[2]);
        CHECK_THAT(n == 14, "row %d", rows);
        struct bsdf bsdf = bsdf_make((rgb){r, g, b}, roughness, specular, wi.z);
        struct bsdf_value v = bsdf_eval(&bsdf, wi, wo);
        const float base[3] = {r, g, b};
        for (int c = 0; c < 3; c++) {
            double found = (double)(base[c] * v.diffuse + v.specular), wanted = (double)f[c];
            double excess = fabs(found - wanted) / (1e-4 * fabs(wanted) + 1e-6);
            worst = fmax(worst, excess);
            CHECK_THAT(excess <= 1.0, "row %d channel %d: %.9g, wanted %.9g (roughness %g specular %g)", rows, c, found,
                       wanted, (double)roughness, (double)specular);
        }
        rows++;
    }
    fclose(file);
    CHECK(rows == 2400);
    printf("principled.csv: %d rows, worst error %.3f of what is allowed\n", rows, worst);
}

static void check_albedo(void) {
    FILE *file = fopen(check_data("conformance/principled_albedo.csv"), "r");
    char line[256];
    CHECK(file && fgets(line, sizeof line, file));
    int row = 0;
    while (fgets(line, sizeof line, file)) {
        float base, roughness, specular, cosine, albedo;
        CHECK(sscanf(line, "%f,%f,%f,%f,%f", &base, &roughness, &specular, &cosine, &albedo) == 5);
        struct bsdf bsdf = bsdf_make(rgb_gray(base), roughness, specular, cosine);
        vec3 wo = {sqrtf(1.0f - cosine * cosine), 0.0f, cosine};
        double sum = 0.0, square = 0.0;
        for (uint64_t i = 0; i < ALBEDO_SAMPLES; i++) {
            uint64_t a = rng_key(1, (uint64_t)row, 2 * i), b = rng_key(1, (uint64_t)row, 2 * i + 1);
            vec3 wi = bsdf_sample(&bsdf, wo, rng_to_float((uint32_t)a), rng_to_float((uint32_t)(a >> 32)),
                                  rng_to_float((uint32_t)b));
            struct bsdf_value v = bsdf_eval(&bsdf, wo, wi);
            double value = v.pdf > 0.0f ? (double)((base * v.diffuse + v.specular) / v.pdf) : 0.0;
            sum += value;
            square += value * value;
        }
        double mean = sum / ALBEDO_SAMPLES;
        double error = sqrt(fmax(0.0, square / ALBEDO_SAMPLES - mean * mean) / ALBEDO_SAMPLES);
        /* Theirs has 2^20 samples, of which the half that takes the other lobe brings about
         * nothing: their spread is about the mean itself. */
        error = sqrt(error * error + pow((double)albedo / 1024.0, 2.0));
        CHECK_THAT(fabs(mean - (double)albedo) <= 3.5 * error + 1e-6,
                   "base %g roughness %g specular %g cosine %g: %g +- %g, wanted %g", (double)base, (double)roughness,
                   (double)specular, (double)cosine, mean, error, (double)albedo);
        row++;
    }
    fclose(file);
    CHECK(row == 108);
}

int main(void) {
    check_values();
    check_albedo();
    return check_result();
}
