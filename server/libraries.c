/* libraries.c -- see libraries.h. */
#include "server/libraries.h"

#include <archive.h>
#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>

#include "common/buf.h"
#include "common/color_icc.h"
#include "common/image.h"
#include "common/mem.h"
#include "common/request.h"
#include "server/ingest/mesh/gltf_meshopt.h"
#include "server/ingest/name_key.h"
#include "server/ingest/source/xml.h"
#include "server/net/tls.h"
#include "server/render/accel.h"
#include "server/store/store.h"
#include "server/transport/listener.h"
#include "server/worker/confine.h"

/* Some begin their version with their name. */
static struct library named(const char *name, const char *prefix, const char *version) {
    struct library made = {.name = name};
    size_t length = strlen(prefix);
    snprintf(made.version, sizeof made.version, "%s",
             strncmp(version, prefix, length) == 0 ? version + length : version);
    return made;
}

/* One that writes its version. */
static struct library written(const char *name, void (*write)(char text[LIBRARY_VERSION_SIZE])) {
    struct library made = {.name = name};
    write(made.version);
    return made;
}

void libraries_list(struct library list[LIBRARY_COUNT]) {
    const struct library all[LIBRARY_COUNT] = {
        named("libmicrohttpd", "", listener_library_version()),
        named("libcurl", "", request_library_version()),
        named("gnutls", "", tls_library_version()),
        named("sqlite", "", store_library_version()),
        named("embree", "Embree ", accel_library_version()),
        named("libarchive", "libarchive ", archive_version_string()),
        named("cjson", "", cJSON_Version()),
        written("openexr", image_exr_version),
        named("libpng", "", image_png_version()),
        named("libjpeg", "", image_jpeg_version()),
        named("zlib", "", image_zlib_version()),
        written("libtiff", image_tiff_version),
        named("libheif", "", image_heif_version()),
        written("libwebp", image_webp_version),
        written("lcms2", color_icc_version),
        named("meshoptimizer", "", gltf_meshopt_version()),
        named("libexpat", "expat_", xml_library_version()),
        written("libunistring", name_key_library_version),
        written("libseccomp", confine_library_version),
    };
    memcpy(list, all, sizeof all);
}

char *libraries_text(void) {
    struct library list[LIBRARY_COUNT];
    struct buf text;
    libraries_list(list);
    buf_init(&text, 4096);
    for (size_t i = 0; i < LIBRARY_COUNT; i++)
        buf_printf(&text, "%s%s %s", i ? ", " : "", list[i].name, list[i].version);
    char *copy = mem_strdup(buf_text(&text));
    buf_release(&text);
    return copy;
}

const char *libraries_lack(void) {
    return !archive_zlib_version()      ? "libarchive was built without zlib: no .zip or .tar.gz can be read"
           : !archive_libzstd_version() ? "libarchive was built without zstd: no .tar.zst can be read"
                                        : image_heif_lacks();
}
