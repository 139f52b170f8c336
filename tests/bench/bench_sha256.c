/* Bytes a second through SHA-256: the form that the daemon picks on this machine, over the portable one; and beside
 * OpenSSL's, where its program is there. Prints lines "name value goal better". */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "common/mem.h"
#include "common/sha256.h"
#include "common/sha256_blocks.h"

#define BYTES ((size_t)1 << 20)
#define SECONDS 0.5 /* of processor time, as OpenSSL measures, and each try; the best of REPEATS counts */
#define REPEATS 3

static double cpu_sec(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double rate(sha256_blocks *blocks, const uint8_t *data) {
    double best = 0.0;
    for (int i = 0; i < REPEATS; i++) {
        struct sha256 s;
        double start = cpu_sec(), now = start, bytes = 0.0;
        sha256_init(&s);
        for (; now - start < SECONDS; now = cpu_sec(), bytes += (double)BYTES)
            blocks(s.state, data, BYTES / 64);
        best = fmax(best, bytes / (now - start));
    }
    return best;
}

/* OpenSSL's own bench, in bytes a second; 0 where it is not there. */
static double openssl_rate(void) {
    char line[512];
    double kilobytes = 0.0;
    FILE *pipe = popen("openssl speed -seconds 1 -bytes 1048576 -evp sha256 2>/dev/null", "r");
    while (pipe && fgets(line, sizeof line, pipe))
        if (sscanf(line, "sha256 %lfk", &kilobytes) != 1)
            (void)sscanf(line, "SHA256 %lfk", &kilobytes);
    if (pipe)
        pclose(pipe);
    return kilobytes * 1e3;
}

int main(void) {
    uint8_t *data = mem_calloc(BYTES, 1);
    sha256_blocks *native = sha256_blocks_native();
    double portable = rate(sha256_blocks_portable, data), picked = native ? rate(native, data) : portable;
    double openssl = openssl_rate();
    printf("SHA-256 in portable C, MB/s\t%.0f\t-\thigher\n", portable * 1e-6);
    printf("SHA-256 as picked here, MB/s\t%.0f\t-\thigher\n", picked * 1e-6);
    if (openssl > 0.0)
        printf("SHA-256 of OpenSSL, MB/s\t%.0f\t-\thigher\n", openssl * 1e-6);
    mem_free(data);
    return 0;
}
