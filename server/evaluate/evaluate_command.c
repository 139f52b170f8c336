/* evaluate_command.c -- `unbaked evaluate`: its options and its table. */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/arguments.h"
#include "server/evaluate/evaluate.h"

static const char usage[] =
    "usage: unbaked evaluate ROOM OUTPUTS [option ...]\n"
    "\n"
    "Compares the outputs of a finished job (a folder that `unbake get` filled) with the truth of\n"
    "its room (ROOM/truth, as `unbaked demo-room` writes it), as the held-out cameras see them.\n"
    "\n"
    "  --spp N          paths per pixel of the re-rendered views (64); 0: none, no MSRE\n"
    "  --samples N      first hits per pixel of the parameters (16)\n"
    "  --max-depth N    segments of a path (16)\n"
    "  --pictures DIR   write side-by-sides there: truth | recovered, photograph | re-render\n"
    "  --json           one JSON object instead of a table\n"
    "  --threads N      0: one for each processor (0)\n"
    "\n"
    "example: unbaked evaluate build/demo/room build/demo/out --pictures build/demo/pictures\n";

struct arguments {
    struct evaluate_settings settings;
    uint32_t threads;
    bool json, help;
    const char *room, *outputs;
};

static bool read_count(const char *option, double low, double high, uint32_t *count) {
    double value;
    bool ok = argument_number("evaluate", option, optarg, low, high, true, &value);
    *count = ok ? (uint32_t)value : *count;
    return ok;
}

static bool read_arguments(int argc, char **argv, struct arguments *a) {
    static const struct option option[] = {
        {"spp", required_argument, NULL, 's'},     {"samples", required_argument, NULL, 'n'},
        {"max-depth", required_argument, NULL, 'd'}, {"pictures", required_argument, NULL, 'p'},
        {"json", no_argument, NULL, 'j'},          {"threads", required_argument, NULL, 't'},
        {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0},
    };
    bool ok = true;
    optind = 1;
    for (int c; ok && (c = getopt_long(argc, argv, "", option, NULL)) != -1;) {
        switch (c) {
        case 's': ok = read_count("spp", 0, 1 << 20, &a->settings.spp); break;
        case 'n': ok = read_count("samples", 16, 4096, &a->settings.samples); break;
        case 'd': ok = read_count("max-depth", 2, 32, &a->settings.max_depth); break;
        case 'p': a->settings.pictures_dir = optarg; break;
        case 'j': a->json = true; break;
        case 't': ok = read_count("threads", 0, 1024, &a->threads); break;
        case 'h': a->help = true; return true;
        default: ok = false;
        }
    }
    if (ok && optind != argc - 2) {
        fprintf(stderr, "unbaked evaluate: name the room's folder and the outputs' folder; --help "
                        "says more\n");
        ok = false;
    }
    if (ok) {
        a->room = argv[optind];
        a->outputs = argv[optind + 1];
    }
    return ok;
}

static void print_table(const struct evaluation *v) {
    const struct score *s = &v->score;
    printf("recovered against true, over %zu held-out views\n", v->view_count);
    printf("  %-22s %6.2f dB   (%.1f %% of the pixels; with unseen surface %.2f dB)\n",
           "base colour", score_psnr_db(s->base_color_seen),
           s->plain_pixels ? 100.0 * (double)s->seen_pixels / (double)s->plain_pixels : 0.0,
           score_psnr_db(s->base_color_all));
    printf("  %-22s %6.2f dB   (off by %.3f)\n", "roughness", score_psnr_db(s->roughness),
           sqrt(score_mean(s->roughness)));
    printf("  %-22s %6.2f dB   (off by %.3f)\n", "specular", score_psnr_db(s->specular),
           sqrt(score_mean(s->specular)));
    printf("  %-22s %zu of %zu found, %zu missed, %zu false\n", "emitters", v->emitters_found,
           v->emitters, v->emitters_missed, v->emitters_false);
    printf("  %-22s %6.3f of 1, log error %.2g\n", "emission, overlap", score_emission_iou(s),
           score_mean(s->emission_log));
    if (isfinite(v->msre))
        printf("  %-22s %6.4f +- %.4f\n", "MSRE of re-renders", v->msre, v->msre_deviation);
    if (v->even.count > 0)
        printf("  %-22s %6.4f of which the photographs' own noise is %.4f (%.1f %% of the pixels)\n",
               "  where all is even", v->even.render / (double)v->even.count,
               v->even.noise / (double)v->even.count, 100.0 * (double)v->even.count / (double)s->pixels);
    if (v->floor.count > 0)
        printf("  %-22s %6.4f of which the photographs' own noise is %.4f (by the errors of the truth's renders)\n",
               v->floor.count == 1 ? "  in one view" : "  in some views", v->floor.msre / (double)v->floor.count,
               v->floor.floor / (double)v->floor.count);
}

int evaluate_command(int argc, char **argv) {
    struct arguments a = {.settings = evaluate_default_settings()};
    struct evaluation evaluation;
    struct error err;
    if (!read_arguments(argc, argv, &a))
        return EXIT_USAGE;
    if (a.help) {
        fputs(usage, stdout);
        return EXIT_SUCCESS;
    }
    struct parallel *pool = parallel_new((int)a.threads);
    enum status status = evaluate_outputs(a.room, a.outputs, &a.settings, pool, &evaluation, &err);
    parallel_free(pool);
    if (status != STATUS_OK) {
        fprintf(stderr, "unbaked evaluate: %s\n", err.message);
        return EXIT_FAILURE;
    }
    if (a.json) {
        cJSON *root = evaluate_to_json(&evaluation);
        char *text = json_text(root);
        puts(text);
        mem_free(text);
        cJSON_Delete(root);
    } else {
        print_table(&evaluation);
    }
    return EXIT_SUCCESS;
}
