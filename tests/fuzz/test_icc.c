/* test_icc.c -- ICC profiles, as a picture brings them: whatever they are, a warning or a conversion, and never a
 * crash. */
#include <lcms2.h>

#include "common/color_icc.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

static volatile float kept; /* so that the conversion is not left out */

static void use(const uint8_t *data, size_t size, bool is_grey) {
    struct color color;
    float pixel[3][4] = {{0, 0.5f, 1, 1}, {0.2f, 0.2f, 0.2f, 1}, {1, 1, 1, 1}};
    size_t outside = 0;
    color_init(&color);
    color_set_profile(&color, data, size, is_grey, 8);
    MUST(memchr(color.name, '\0', sizeof color.name) && memchr(color.warning, '\0', sizeof color.warning));
    MUST(color.is_srgb || (color.name[0] && !color.warning[0] && !color.curve == !!color.profile));
    if (!color.is_srgb)
        color_convert(&color, &pixel[0][0], 4, 3, &outside);
    MUST(outside <= 3 && pixel[0][3] == 1);
    kept = pixel[0][0];
    color_release(&color);
    MUST(color.is_srgb && !color.curve && !color.profile);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    use(data, size, false);
    use(data, size, true);
    return 0;
}

static void add(struct seeds *s, cmsHPROFILE profile) {
    cmsUInt32Number size = 0;
    MUST(profile && cmsSaveProfileToMem(profile, NULL, &size));
    void *data = mem_alloc(size);
    MUST(cmsSaveProfileToMem(profile, data, &size));
    seeds_add(s, data, size);
    mem_free(data);
    cmsCloseProfile(profile);
}

/* Red, green, blue by curves of each kind; by tables; grey; and two that no picture has. */
void fuzz_seeds(struct seeds *s) {
    cmsCIExyY white = {0.3127, 0.3290, 1};
    cmsCIExyYTRIPLE p3 = {{0.680, 0.320, 1}, {0.265, 0.690, 1}, {0.150, 0.060, 1}};
    const cmsUInt16Number table[5] = {0, 4000, 16000, 36000, 65535};
    cmsToneCurve *gamma = cmsBuildGamma(NULL, 1.8), *tabled = cmsBuildTabulatedToneCurve16(NULL, 5, table);
    s->mutants = 3000;
    add(s, cmsCreateRGBProfile(&white, &p3, (cmsToneCurve *[3]){gamma, gamma, gamma}));
    add(s, cmsCreateRGBProfile(&white, &p3, (cmsToneCurve *[3]){tabled, gamma, tabled}));
    add(s, cmsCreate_sRGBProfile());
    add(s, cmsCreateGrayProfile(&white, gamma));
    add(s, cmsCreateLab4Profile(NULL));
    add(s, cmsCreateLinearizationDeviceLink(cmsSigRgbData, (cmsToneCurve *[3]){gamma, gamma, gamma}));
    cmsHPROFILE tables = cmsCreateRGBProfile(&white, &p3, (cmsToneCurve *[3]){gamma, gamma, gamma});
    cmsPipeline *pipeline = cmsPipelineAlloc(NULL, 3, 3);
    cmsPipelineInsertStage(pipeline, cmsAT_BEGIN,
                           cmsStageAllocToneCurves(NULL, 3, (cmsToneCurve *[3]){gamma, gamma, gamma}));
    cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocCLut16bit(NULL, 3, 3, 3, NULL));
    cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocToneCurves(NULL, 3, NULL));
    MUST(cmsWriteTag(tables, cmsSigAToB0Tag, pipeline));
    cmsPipelineFree(pipeline);
    add(s, tables);
    cmsFreeToneCurve(gamma);
    cmsFreeToneCurve(tabled);
}
