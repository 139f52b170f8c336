/* image_foreign.c -- see image_foreign.h. Magic numbers: those of libmagic (file 5.44), which has each. */
#include "common/image_foreign.h"

#include <string.h>
#include <strings.h>

#include "common/image.h"

static const struct {
    size_t offset;
    const char *magic;
    size_t length;
    const char *kind; /* NULL: camera raw */
} kinds[] = {
    {8, "CR\x02\0", 4, NULL},            /* Canon CR2 */
    {4, "ftypcrx ", 8, NULL},            /* Canon CR3 */
    {6, "HEAPCCDR", 8, NULL},            /* Canon CRW */
    {0, "FUJIFILMCCD-RAW", 15, NULL},    /* Fujifilm RAF */
    {0, "IIRO", 4, NULL},                /* Olympus ORF, three spellings */
    {0, "IIRS", 4, NULL},                /**/
    {0, "MMOR", 4, NULL},                /**/
    {0, "IIU\0", 4, NULL},               /* Panasonic RW2 */
    {0, "\0MRM", 4, NULL},               /* Minolta MRW */
    {0, "FOVb", 4, NULL},                /* Sigma X3F */
    {0, "\xff\x0a", 2, "JPEG XL"},       /* bare codestream */
    {4, "JXL \r\n\x87\n", 8, "JPEG XL"}, /**/
    {4, "jP  \r\n\x87\n", 8, "JPEG 2000"},
    {0, "\xff\x4f\xff\x51", 4, "JPEG 2000"},
    {0, "8BPS", 4, "Photoshop"},
    {0, "GIF8", 4, "GIF"},
    {0, "BM", 2, "BMP"},
    {0, "DDS ", 4, "DDS"},
    {0, "%PDF", 4, "PDF"},
};

static const char *const raw_extensions[] = {"dng", "cr2", "nef", "nrw", "arw", "sr2", "srf", "pef",
                                             "srw", "raf", "orf", "rw2", "rwl", "3fr", "fff", "iiq",
                                             "erf", "kdc", "dcr", "mos", "mef", "cr3"};

bool image_is_raw_name(const char *name) {
    const char *dot = strrchr(name, '.');
    for (size_t i = 0; dot && i < sizeof raw_extensions / sizeof *raw_extensions; i++)
        if (strcasecmp(dot + 1, raw_extensions[i]) == 0)
            return true;
    return false;
}

enum status image_refuse_raw(const char *name, struct error *err) {
    error_set(err, STATUS_INPUT, "%s: a camera's raw file is not a picture yet", name);
    return error_hint(err, "develop all of them alike to 16-bit linear TIFF or PNG with a colour profile, without tone "
                           "curve and lens correction (darktable, RawTherapee; dcraw -4 -T)");
}

bool image_is_foreign(const char *name, const char *start, size_t length, struct error *err) {
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        if (length < kinds[i].offset + kinds[i].length ||
            memcmp(start + kinds[i].offset, kinds[i].magic, kinds[i].length) != 0)
            continue;
        if (!kinds[i].kind) {
            image_refuse_raw(name, err);
        } else {
            error_set(err, STATUS_INPUT, "%s: %s is not read", name, kinds[i].kind);
            error_hint(err, "save it as PNG, TIFF, JPEG or EXR");
        }
        return true;
    }
    return false;
}
