/* Derivatives of path radiances, by every kind of parameter, through one bounce and through many,
 * against central differences with common random numbers; and what the two-estimate loss is for.
 *
 * Where the parameter moves no sampling decision the two agree path by path. Where it does
 * (roughness and specular of a glossy surface) they differ per path, having the same mean: a z-test
 * over many groups. */
#include "tests/render/box.h"

#define BATCH 512

/* A parameter of the box. */
enum kind { TEXEL, SEGMENT_COLOR, ROUGHNESS, SPECULAR, EMISSION };

struct parameter {
    const char *name;
    enum kind kind;
    uint32_t which; /* texel or segment */
    bool exact;     /* moves no sampling decision */
    int depth;
};

/* The wall texture's rectangle of the slab's block, or the like. */
static bool texel_of_segment(uint32_t texel, uint32_t segment) {
    uint32_t x = texel % BOX_SIDE, y = texel / BOX_SIDE;
    return segment == 0 ? y < 36 : segment == 1 ? y >= 36 && x < 14 : y >= 36 && x >= 14;
}

static void nudge(struct box *b, const struct parameter *p, float amount) {
    struct materials *m = &b->materials;
    switch (p->kind) {
    case TEXEL: m->base_color.texel[p->which][1] += amount; break;
    case SEGMENT_COLOR:
        for (uint32_t i = 0; i < BOX_SIDE * BOX_SIDE; i++)
            for (int c = 0; c < 3 && texel_of_segment(i, p->which); c++)
                m->base_color.texel[i][c] += amount;
        break;
    case ROUGHNESS: m->roughness[p->which] += amount; break;
    case SPECULAR: m->specular[p->which] += amount; break;
    case EMISSION:
        m->emission[p->which].g += amount;
        world_update_lights(&b->world);
        break;
    }
}

static double read_log(const struct gradient_log *log, const struct parameter *p) {
    double sum = 0.0;
    if (p->kind == ROUGHNESS)
        return log->segment[p->which].d_roughness;
    if (p->kind == SPECULAR)
        return log->segment[p->which].d_specular;
    if (p->kind == EMISSION)
        return log->segment[p->which].d_emission[1];
    for (size_t i = 0; i < log->entry_count; i++) {
        const struct gradient_entry *e = &log->entry[i];
        for (uint32_t k = 0; k < 4; k++) {
            if (e->weight[k] == 0.0f)
                continue;
            uint32_t texel = e->x + k % 2 + (e->y + k / 2) * BOX_SIDE;
            if (p->kind == TEXEL && texel == p->which)
                sum += (double)(e->weight[k] * e->d.g);
            else if (p->kind == SEGMENT_COLOR && texel_of_segment(texel, p->which))
                sum += (double)(e->weight[k] * (e->d.r + e->d.g + e->d.b));
        }
    }
    return sum;
}

/* The sum of all channels of the batch's radiances. */
static double trace(struct path_batch *batch, const struct box *b, const struct path_settings *settings, uint32_t group,
                    rgb *radiance) {
    struct ray ray[BATCH];
    struct path_key key[BATCH];
    for (uint32_t i = 0; i < BATCH; i++) {
        ray[i] = box_ray(group * BATCH + i);
        key[i] = (struct path_key){group * BATCH + i, 0, 0};
    }
    path_batch_trace(batch, &b->world, settings, BATCH, ray, key, radiance);
    double sum = 0.0;
    for (int i = 0; i < BATCH; i++)
        sum += (double)(radiance[i].r + radiance[i].g + radiance[i].b);
    return sum;
}

static void check_parameter(struct box *b, const struct parameter *p) {
    struct path_settings settings = {.max_depth = p->depth, .roulette_depth = 99, .seed = 21};
    struct path_batch *batch = path_batch_new(BATCH, p->depth);
    struct gradient_log *log = gradient_log_new(3);
    rgb radiance[BATCH], one[BATCH];
    for (int i = 0; i < BATCH; i++)
        one[i] = (rgb){1.0f, 1.0f, 1.0f};
    float h = p->kind == EMISSION ? 0.5f : p->kind == SEGMENT_COLOR ? 0.01f : 0.02f;
    if (p->kind == TEXEL)
        h = 0.1f;
    uint32_t groups = p->exact ? 20 : 300;
    double found = 0.0, wanted = 0.0, square = 0.0, size = 0.0;
    for (uint32_t g = 0; g < groups; g++) {
        trace(batch, b, &settings, g, radiance);
        gradient_log_clear(log);
        path_batch_backward(batch, one, log);
        double ours = read_log(log, p);
        nudge(b, p, h);
        double up = trace(batch, b, &settings, g, radiance);
        nudge(b, p, -2.0f * h);
        double down = trace(batch, b, &settings, g, radiance);
        nudge(b, p, h);
        double theirs = (up - down) / (2.0 * (double)h);
        found += ours / groups;
        wanted += theirs / groups;
        size += fabs(ours) / groups;
        square += (ours - theirs) * (ours - theirs) / groups;
    }
    double error = p->exact ? 2e-3 * size + 2e-3
                            : 3.5 * sqrt((square - (found - wanted) * (found - wanted)) / groups) + 1e-3 * size;
    printf("%-34s depth %d: %.6g, differences %.6g +- %.2g\n", p->name, p->depth, found, wanted, error);
    CHECK_THAT(fabs(found - wanted) <= error, "%s: %g, differences say %g +- %g", p->name, found, wanted, error);
    CHECK_THAT(size > 0.0, "%s: no derivative at all", p->name);
    gradient_log_free(log);
    path_batch_free(batch);
}

/* What does not shine has a derivative by emission too: it would, if it did. */
static void check_dark_emission(struct box *b) {
    struct path_settings settings = {.max_depth = 3, .roulette_depth = 99, .seed = 22};
    struct path_batch *batch = path_batch_new(BATCH, 3);
    struct gradient_log *log = gradient_log_new(3);
    rgb radiance[BATCH], one[BATCH];
    for (int i = 0; i < BATCH; i++)
        one[i] = (rgb){1.0f, 1.0f, 1.0f};
    trace(batch, b, &settings, 0, radiance);
    path_batch_backward(batch, one, log);
    CHECK(log->segment[1].d_emission[0] > 0.0);
    gradient_log_free(log);
    path_batch_free(batch);
}

/* A batch that keeps no vertices traces the same paths. */
static void check_forward(const struct box *b) {
    struct path_settings settings = {.max_depth = 7, .roulette_depth = 3, .seed = 23};
    struct path_batch *keeps = path_batch_new(BATCH, 7), *forward = path_batch_new_forward(BATCH);
    rgb kept[BATCH], found[BATCH];
    CHECK(trace(keeps, b, &settings, 0, kept) > 0.0);
    trace(forward, b, &settings, 0, found);
    CHECK(memcmp(kept, found, sizeof kept) == 0);
    path_batch_free(keeps);
    path_batch_free(forward);
}

static void check_parameters(void) {
    struct box b;
    box_init(&b);
    box_build(&b);
    /* Not glossy: base colour and roughness move no decision. One emitter: neither does it. */
    const uint32_t texel = 8 * BOX_SIDE + 40; /* on the back wall */
    const struct parameter matte[] = {
        {"a texel", TEXEL, texel, true, 2},
        {"a texel", TEXEL, texel, true, 7},
        {"walls' base colour", SEGMENT_COLOR, 0, true, 2},
        {"walls' base colour", SEGMENT_COLOR, 0, true, 7},
        {"slab's base colour", SEGMENT_COLOR, 1, true, 7},
        {"lamp's base colour", SEGMENT_COLOR, 2, true, 7},
        {"walls' roughness (matte)", ROUGHNESS, 0, true, 2},
        {"walls' roughness (matte)", ROUGHNESS, 0, true, 7},
        {"lamp's emission", EMISSION, 2, true, 1},
        {"lamp's emission", EMISSION, 2, true, 2},
        {"lamp's emission", EMISSION, 2, true, 7},
    };
    for (size_t i = 0; i < sizeof matte / sizeof *matte; i++)
        check_parameter(&b, &matte[i]);
    b.materials.specular[0] = 0.4f;
    b.materials.specular[1] = 0.9f;
    b.materials.roughness[1] = 0.3f;
    const struct parameter glossy[] = {
        {"slab's roughness", ROUGHNESS, 1, false, 2}, {"slab's roughness", ROUGHNESS, 1, false, 6},
        {"walls' roughness", ROUGHNESS, 0, false, 6}, {"slab's specular", SPECULAR, 1, false, 2},
        {"walls' specular", SPECULAR, 0, false, 6},   {"walls' base colour (glossy)", SEGMENT_COLOR, 0, false, 6},
    };
    for (size_t i = 0; i < sizeof glossy / sizeof *glossy; i++)
        check_parameter(&b, &glossy[i]);
    check_dark_emission(&b);
    check_forward(&b);
    box_release(&b);
}

/* The same without a ceiling under a sky that is brighter on one side: the environment's samples take
 * the place of most of the lamp's, whose emission now moves the choice between the two. */
static void check_under_sky(void) {
    static float pixel[33 * 64 * 3];
    struct image sky = {.width = 64, .height = 33, .channel_count = 3, .pixel = pixel};
    for (int i = 0; i < 33 * 64 * 3; i++)
        pixel[i] = i % 192 < 96 ? 1.5f : 12.0f;
    struct box b;
    box_init(&b);
    box_open(&b);
    box_build(&b);
    struct parallel *pool = parallel_new(1);
    world_set_environment(&b.world, &sky, pool);
    parallel_free(pool);
    CHECK(b.world.lights->environment_chance > 0.2f && b.world.lights->environment_chance < 0.95f);
    const struct parameter parameters[] = {
        {"a texel under a sky", TEXEL, 8 * BOX_SIDE + 40, true, 7},
        {"walls' base colour under a sky", SEGMENT_COLOR, 0, true, 2},
        {"walls' base colour under a sky", SEGMENT_COLOR, 0, true, 7},
        {"walls' roughness under a sky", ROUGHNESS, 0, true, 7},
        {"lamp's emission under a sky", EMISSION, 2, false, 7},
    };
    for (size_t i = 0; i < sizeof parameters / sizeof *parameters; i++)
        check_parameter(&b, &parameters[i]);
    check_forward(&b);
    box_release(&b);
}

/* The same where the lamp shows a picture: its emission is the mean of it. */
static void check_picture(void) {
    struct box b;
    box_init(&b);
    materials_start_emission_pattern(&b.materials);
    for (uint32_t i = 0; i < BOX_SIDE * BOX_SIDE; i++) {
        float random[3];
        for (uint32_t c = 0; c < 3; c++)
            random[c] = 2.0f * rng_to_float((uint32_t)rng_key(9, i, c));
        if (texel_of_segment(i, 2))
            materials_set_emission_pattern(&b.materials, i, rgb_make(random[0], random[1], random[2]), rgb_gray(1.0f));
    }
    box_build(&b);
    const struct parameter parameters[] = {
        {"emission of a picture", EMISSION, 2, true, 1},
        {"emission of a picture", EMISSION, 2, true, 2},
        {"emission of a picture", EMISSION, 2, true, 7},
        {"a texel under a picture", TEXEL, 8 * BOX_SIDE + 40, true, 7},
    };
    for (size_t i = 0; i < sizeof parameters / sizeof *parameters; i++)
        check_parameter(&b, &parameters[i]);
    check_forward(&b);
    box_release(&b);
}

/* --- the loss of two estimates ---------------------------------------------------------------- */

enum { PIXELS = 64, ROUNDS = 6000, SLOPE_PARTS = 48, LOSS_DEPTH = 3 };
static const float target = 0.4f;
static const struct parameter walls = {"walls", SEGMENT_COLOR, 0, true, LOSS_DEPTH};

struct loss_rig {
    struct box box;
    struct path_batch *batch[2]; /* of the two estimates */
    struct gradient_log *log;
    double mean[PIXELS][3]; /* radiance */
};

/* A mean over the rounds, with what its standard error is made of. */
struct estimate {
    double mean, square;
};

static void estimate_add(struct estimate *e, double value) {
    e->mean += value / ROUNDS;
    e->square += value * value / ROUNDS;
}

static double estimate_error(const struct estimate *e) { return sqrt((e->square - e->mean * e->mean) / ROUNDS); }

static void trace_keys(struct loss_rig *rig, int batch, const struct ray *ray, const struct path_key *key,
                       rgb *radiance) {
    const struct path_settings settings = {.max_depth = LOSS_DEPTH, .roulette_depth = 99, .seed = 23};
    path_batch_trace(rig->batch[batch], &rig->box.world, &settings, PIXELS, ray, key, radiance);
}

/* The derivative by the walls' base colour of the batch's radiances times `adjoint`. */
static double walk_back(struct loss_rig *rig, int batch, const rgb *adjoint) {
    gradient_log_clear(rig->log);
    path_batch_backward(rig->batch[batch], adjoint, rig->log);
    return read_log(rig->log, &walls);
}

/* The gradient from two halves of one sample a pixel, each with the other's residual (`two`) or with
 * its own (`one`). */
static void measure_estimates(struct loss_rig *rig, struct estimate *two, struct estimate *one) {
    for (uint32_t round = 0; round < ROUNDS; round++) {
        struct ray ray[PIXELS];
        struct path_key key[PIXELS];
        rgb radiance[2][PIXELS], adjoint[PIXELS];
        for (uint32_t half = 0; half < 2; half++) {
            for (uint32_t i = 0; i < PIXELS; i++) {
                ray[i] = box_ray(i);
                key[i] = (struct path_key){i, 2 * round + half, 0};
            }
            trace_keys(rig, (int)half, ray, key, radiance[half]);
        }
        for (int own = 0; own < 2; own++) {
            double value = 0.0;
            for (int half = 0; half < 2; half++) {
                for (int i = 0; i < PIXELS; i++) {
                    rgb from = radiance[own ? half : 1 - half][i];
                    adjoint[i] = (rgb){from.r - target, from.g - target, from.b - target};
                }
                value += walk_back(rig, half, adjoint);
            }
            estimate_add(own ? one : two, value);
        }
        for (int i = 0; i < PIXELS; i++) {
            rig->mean[i][0] += (double)radiance[0][i].r / ROUNDS;
            rig->mean[i][1] += (double)radiance[0][i].g / ROUNDS;
            rig->mean[i][2] += (double)radiance[0][i].b / ROUNDS;
        }
    }
}

/* The derivative of one channel of a pixel's radiance, by many samples of that pixel. */
static double measure_slope(struct loss_rig *rig, uint32_t pixel, int channel) {
    struct ray ray[PIXELS];
    struct path_key key[PIXELS];
    rgb radiance[PIXELS], adjoint[PIXELS];
    double sum = 0.0;
    for (uint32_t part = 0; part < SLOPE_PARTS; part++) {
        for (uint32_t k = 0; k < PIXELS; k++) {
            ray[k] = box_ray(pixel);
            key[k] = (struct path_key){pixel, 100000, part * PIXELS + k};
            adjoint[k] = (rgb){channel == 0, channel == 1, channel == 2};
        }
        trace_keys(rig, 0, ray, key, radiance);
        sum += walk_back(rig, 0, adjoint) / (SLOPE_PARTS * PIXELS);
    }
    return sum;
}

/* d/d(walls' base colour) of sum (mean radiance - target)^2 at one sample per pixel: from two
 * independent estimates without bias, from one with. */
static void check_loss(void) {
    struct loss_rig rig = {.batch = {path_batch_new(PIXELS, LOSS_DEPTH), path_batch_new(PIXELS, LOSS_DEPTH)},
                           .log = gradient_log_new(3)};
    struct estimate two = {0}, one = {0};
    box_init(&rig.box);
    box_build(&rig.box);
    measure_estimates(&rig, &two, &one);
    double truth = 0.0;
    for (uint32_t i = 0; i < PIXELS; i++)
        for (int c = 0; c < 3; c++)
            truth += 2.0 * (rig.mean[i][c] - (double)target) * measure_slope(&rig, i, c);
    double two_error = estimate_error(&two), one_error = estimate_error(&one);
    printf("squared loss: truth %.4f; two estimates %.4f +- %.4f; one %.4f +- %.4f\n", truth, two.mean, two_error,
           one.mean, one_error);
    double slack = 0.01 * fabs(truth); /* of the truth's own sampling */
    CHECK(fabs(two.mean - truth) < 3.5 * two_error + slack);
    CHECK(fabs(one.mean - truth) > 8.0 * one_error + slack);
    gradient_log_free(rig.log);
    path_batch_free(rig.batch[0]);
    path_batch_free(rig.batch[1]);
    box_release(&rig.box);
}

int main(void) {
    check_parameters();
    check_under_sky();
    check_picture();
    check_loss();
    return check_result();
}
