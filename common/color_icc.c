/* color_icc.c -- see color_icc.h.
 *
 * Most camera profiles are three curves and a matrix: these are extracted and applied by us, 20 times as fast as by
 * the library. Others (3D tables, grey) go through the library. The intent is relative colorimetric: the file's white
 * becomes Rec. 709's.
 *
 * Profiles are untrusted input: errors of the library become a warning, and the picture is read as sRGB. The library
 * uses our allocator and no files. */
#include "common/color_icc.h"

#include <lcms2.h>
#include <lcms2_plugin.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"

/* Largest single allocation of the library. */
#define MAX_ALLOCATION ((size_t)256 << 20)
/* Tolerance for sRGB's curve: profiles have rounded tables. */
#define SAME_CURVE 1e-3f

struct color_icc {
    cmsContext context;
    cmsHPROFILE profile, rec709;
    cmsHTRANSFORM transform;
    bool is_grey;
    char complaint[96]; /* the library's first */
};

/* --- the library --------------------------------------------------------------------------- */

static void *allocate(cmsContext context, cmsUInt32Number bytes) {
    (void)context;
    return bytes <= MAX_ALLOCATION ? mem_alloc(bytes) : NULL;
}

static void release(cmsContext context, void *memory) {
    (void)context;
    mem_free(memory);
}

static void *reallocate(cmsContext context, void *memory, cmsUInt32Number bytes) {
    (void)context;
    return bytes <= MAX_ALLOCATION ? mem_realloc_array(memory, bytes, 1) : NULL;
}

static void note_complaint(cmsContext context, cmsUInt32Number code, const char *text) {
    struct color_icc *icc = cmsGetContextUserData(context);
    (void)code;
    if (icc && icc->complaint[0] == '\0')
        for (size_t i = 0; text[i] && i < sizeof icc->complaint - 1; i++)
            icc->complaint[i] = text[i] >= ' ' && text[i] <= '~' ? text[i] : '?';
}

static struct color_icc *start(void) {
    cmsPluginMemHandler memory = {
        .base = {.Magic = cmsPluginMagicNumber, .ExpectedVersion = 2060, .Type = cmsPluginMemHandlerSig},
        .MallocPtr = allocate,
        .FreePtr = release,
        .ReallocPtr = reallocate,
    };
    struct color_icc *icc = mem_calloc(1, sizeof *icc);
    icc->context = cmsCreateContext(&memory, icc);
    if (icc->context)
        cmsSetLogErrorHandlerTHR(icc->context, note_complaint);
    return icc;
}

static void release_profile(void *profile) {
    struct color_icc *icc = profile;
    if (icc->transform)
        cmsDeleteTransform(icc->transform);
    if (icc->rec709)
        cmsCloseProfile(icc->rec709);
    if (icc->profile)
        cmsCloseProfile(icc->profile);
    if (icc->context)
        cmsDeleteContext(icc->context);
    mem_free(icc);
}

/* Rec. 709 as a profile of linear light. */
static cmsHPROFILE make_rec709(cmsContext context) {
    const struct color_primaries *p = &color_rec709;
    cmsCIExyY white = {p->white[0], p->white[1], 1.0};
    cmsCIExyYTRIPLE primaries = {
        {p->red[0], p->red[1], 1.0}, {p->green[0], p->green[1], 1.0}, {p->blue[0], p->blue[1], 1.0}};
    cmsToneCurve *linear = cmsBuildGamma(context, 1.0);
    cmsToneCurve *curves[3] = {linear, linear, linear};
    cmsHPROFILE profile = linear ? cmsCreateRGBProfileTHR(context, &white, &primaries, curves) : NULL;
    if (linear)
        cmsFreeToneCurve(linear);
    return profile;
}

/* --- what a profile is ---------------------------------------------------------------------- */

/* NULL, or why the profile does not apply to such a picture. */
static const char *misfit(cmsHPROFILE profile, bool is_grey) {
    static char const other[] = "is not of red, green and blue";
    cmsProfileClassSignature class = cmsGetDeviceClass(profile);
    cmsColorSpaceSignature space = cmsGetColorSpace(profile);
    if (class != cmsSigInputClass && class != cmsSigDisplayClass && class != cmsSigOutputClass &&
        class != cmsSigColorSpaceClass)
        return "is not that of a picture";
    return space == cmsSigRgbData || (space == cmsSigGrayData && is_grey) ? NULL : other;
}

static void read_name(cmsHPROFILE profile, char name[COLOR_NAME_SIZE]) {
    char text[COLOR_NAME_SIZE] = "";
    cmsGetProfileInfoASCII(profile, cmsInfoDescription, "en", "US", text, sizeof text);
    text[sizeof text - 1] = '\0';
    for (size_t i = 0; text[i]; i++)
        if (text[i] < ' ' || text[i] > '~')
            text[i] = '?';
    snprintf(name, COLOR_NAME_SIZE, "%s", text[0] ? text : "an ICC profile without a name");
}

/* Extracts curves and matrix; false when the profile is not made of these. *is_srgb: they are sRGB's. */
static bool take_curves(cmsHPROFILE profile, struct color *color, bool *is_srgb) {
    static const cmsTagSignature colorant[3] = {cmsSigRedColorantTag, cmsSigGreenColorantTag, cmsSigBlueColorantTag};
    static const cmsTagSignature tone[3] = {cmsSigRedTRCTag, cmsSigGreenTRCTag, cmsSigBlueTRCTag};
    double xyz[3][3];
    if (cmsGetColorSpace(profile) != cmsSigRgbData || !cmsIsMatrixShaper(profile) ||
        cmsIsCLUT(profile, INTENT_RELATIVE_COLORIMETRIC, LCMS_USED_AS_INPUT))
        return false;
    float off = 0.0f;
    for (int c = 0; c < 3; c++) {
        const cmsCIEXYZ *at = cmsReadTag(profile, colorant[c]);
        const cmsToneCurve *curve = cmsReadTag(profile, tone[c]);
        if (!at || !curve)
            return false;
        xyz[0][c] = at->X;
        xyz[1][c] = at->Y;
        xyz[2][c] = at->Z;
        for (uint32_t i = 0; i < color->step_count; i++) {
            float stored = (float)i / (float)(color->step_count - 1), value = cmsEvalToneCurveFloat(curve, stored);
            if (!isfinite(value))
                return false;
            color->curve[(size_t)c * color->step_count + i] = value;
            off = fmaxf(off, fabsf(value - image_srgb_to_linear(stored)));
        }
    }
    color_matrix_d50(xyz, color->matrix, is_srgb);
    *is_srgb = *is_srgb && off < SAME_CURVE;
    return true;
}

static void convert(const void *profile, float (*pixel)[3], size_t count) {
    const struct color_icc *icc = profile;
    if (icc->is_grey) /* one value in, three out: not in place */
        for (size_t i = 0; i < count; i++) {
            float grey = pixel[i][0];
            cmsDoTransform(icc->transform, &grey, pixel[i], 1);
        }
    else
        cmsDoTransform(icc->transform, pixel, pixel, (cmsUInt32Number)count);
}

static bool make_transform(struct color_icc *icc) {
    icc->is_grey = cmsGetColorSpace(icc->profile) == cmsSigGrayData;
    icc->rec709 = make_rec709(icc->context);
    if (icc->rec709)
        icc->transform =
            cmsCreateTransformTHR(icc->context, icc->profile, icc->is_grey ? TYPE_GRAY_FLT : TYPE_RGB_FLT, icc->rec709,
                                  TYPE_RGB_FLT, INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOOPTIMIZE | cmsFLAGS_NOCACHE);
    float probe[3][3] = {{0.0f, 0.0f, 0.0f}, {0.5f, 0.5f, 0.5f}, {1.0f, 1.0f, 1.0f}}, sum = 0.0f;
    if (!icc->transform)
        return false;
    convert(icc, probe, 3);
    for (int i = 0; i < 9; i++)
        sum += probe[i / 3][i % 3];
    return isfinite(sum);
}

/* Sets `color` from the profile; returns the reason when it cannot. */
static const char *use(struct color_icc *icc, struct color *color, const void *data, size_t size, bool is_grey) {
    static const char damaged[] = "is damaged";
    bool is_srgb = false;
    if (size > UINT32_MAX || !icc->context)
        return damaged;
    icc->profile = cmsOpenProfileFromMemTHR(icc->context, data, (cmsUInt32Number)size);
    if (!icc->profile)
        return damaged;
    const char *why = misfit(icc->profile, is_grey);
    if (why)
        return why;
    read_name(icc->profile, color->name);
    if (take_curves(icc->profile, color, &is_srgb)) {
        color->is_srgb = is_srgb;
        return NULL;
    }
    if (!make_transform(icc))
        return damaged;
    color->is_srgb = false;
    color->profile = icc;
    color->profile_convert = convert;
    color->profile_free = release_profile;
    return NULL;
}

void color_set_profile(struct color *color, const void *profile, size_t size, bool is_grey, int bits) {
    struct color_icc *icc = start();
    color_release(color);
    color->step_count = bits > 8 ? 65536 : 256;
    color->curve = mem_array(3 * (size_t)color->step_count, sizeof *color->curve);
    const char *why = use(icc, color, profile, size, is_grey);
    if (color->profile != icc) {
        if (why)
            snprintf(color->warning, sizeof color->warning, "its ICC profile %s%s%s", why,
                     icc->complaint[0] ? ": " : "", icc->complaint);
        release_profile(icc);
    }
    if (why || color->is_srgb)
        color->name[0] = '\0';
    if (why || color->is_srgb || color->profile) {
        mem_free(color->curve);
        color->curve = NULL;
    }
}

/* --- inks ----------------------------------------------------------------------------------- */

struct color_inks {
    struct color_icc *icc; /* NULL: the plain formula */
};

static bool make_ink_transform(struct color_icc *icc, const void *data, size_t size) {
    if (size == 0 || size > UINT32_MAX || !icc->context)
        return false;
    icc->profile = cmsOpenProfileFromMemTHR(icc->context, data, (cmsUInt32Number)size);
    if (!icc->profile || cmsGetColorSpace(icc->profile) != cmsSigCmykData)
        return false;
    icc->rec709 = cmsCreate_sRGBProfileTHR(icc->context);
    if (icc->rec709)
        icc->transform = cmsCreateTransformTHR(icc->context, icc->profile, TYPE_CMYK_FLT, icc->rec709, TYPE_RGB_FLT,
                                               INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOCACHE);
    return icc->transform != NULL;
}

struct color_inks *color_inks_new(const void *profile, size_t size, char warning[COLOR_WARNING_SIZE]) {
    struct color_inks *inks = mem_calloc(1, sizeof *inks);
    inks->icc = start();
    if (make_ink_transform(inks->icc, profile, size))
        return inks;
    snprintf(warning, COLOR_WARNING_SIZE, "it is CMYK and %s: its colours are estimated",
             size == 0 ? "no profile says of which inks" : "its ICC profile is unusable");
    release_profile(inks->icc);
    inks->icc = NULL;
    return inks;
}

void color_inks_convert(const struct color_inks *inks, const float *cmyk, float *rgb, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const float *ink = cmyk + 4 * i;
        float *out = rgb + 3 * i, percent[4];
        for (int c = 0; c < 4; c++)
            percent[c] = 100.0f * fminf(fmaxf(ink[c], 0.0f), 1.0f);
        for (int c = 0; c < 3; c++)
            out[c] = (1.0f - 0.01f * percent[c]) * (1.0f - 0.01f * percent[3]);
        if (inks->icc)
            cmsDoTransform(inks->icc->transform, percent, out, 1);
        for (int c = 0; c < 3; c++)
            out[c] = fminf(fmaxf(out[c], 0.0f), 1.0f);
    }
}

void color_inks_free(struct color_inks *inks) {
    if (inks->icc)
        release_profile(inks->icc);
    mem_free(inks);
}

void color_icc_version(char text[COLOR_VERSION_SIZE]) {
    int version = cmsGetEncodedCMMversion(); /* 2140 for 2.14 */
    snprintf(text, COLOR_VERSION_SIZE, "%d.%d", version / 1000, version % 1000 / 10);
}
