/* pack.c: the same folder gives the same bytes, whatever its times, modes and order; what comes
 * out is a tar archive that libarchive reads back. */
#include <archive.h>
#include <archive_entry.h>
#include <sys/stat.h>
#include <time.h>

#include "client/pack.h"
#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

static char root[] = "/tmp/unbake-pack-XXXXXX";

static void put(const char *folder, const char *name, size_t bytes, mode_t mode) {
    char *path = mem_printf("%s/%s/%s", root, folder, name);
    char *parent = mem_strndup(path, (size_t)(strrchr(path, '/') - path));
    char *content = mem_alloc(bytes + 1);
    for (size_t i = 0; i < bytes; i++)
        content[i] = (char)(i * 7 + strlen(name));
    CHECK(file_make_dirs(parent, NULL) == STATUS_OK);
    CHECK(file_replace(path, content, bytes, NULL) == STATUS_OK);
    CHECK(chmod(path, mode) == 0);
    mem_free(content);
    mem_free(parent);
    mem_free(path);
}

/* The whole stream, read in pieces of `piece` bytes. */
static enum status drain(struct pack *p, size_t piece, struct buf *out, struct error *err) {
    char *bytes = mem_alloc(piece);
    enum status status = pack_rewind(p, err);
    size_t got = 1;
    while (status == STATUS_OK && got > 0) {
        status = pack_read(p, bytes, piece, &got, err);
        buf_append(out, bytes, status == STATUS_OK ? got : 0);
    }
    mem_free(bytes);
    return status;
}

static void measure(const char *folder, uint64_t *length, char sha256[SHA256_HEX_SIZE]) {
    struct pack *p;
    struct error err;
    char *path = mem_printf("%s/%s", root, folder);
    CHECK_THAT(pack_open(&p, path, &err) == STATUS_OK, "%s", err.message);
    CHECK(pack_measure(p, NULL, NULL, length, sha256, &err) == STATUS_OK);
    /* Read again, in odd pieces: the same bytes. */
    struct buf again;
    char found[SHA256_HEX_SIZE];
    buf_init(&again, 64 << 20);
    CHECK(drain(p, 777, &again, &err) == STATUS_OK);
    sha256_of(buf_text(&again), again.length, found);
    CHECK(again.length == *length);
    CHECK_STRING(found, sha256);
    buf_release(&again);
    pack_close(p);
    mem_free(path);
}

static void test_same_bytes(void) {
    static const char longer[] = "images/a-name-of-more-than-a-hundred-characters-which-the-old-tar-header-"
                                 "does-not-hold-without-help-from-gnu.png";
    uint64_t a_length, b_length;
    char a[SHA256_HEX_SIZE], b[SHA256_HEX_SIZE];
    put("a", "transforms.json", 100, 0600);
    put("a", "images/0001.png", 70000, 0644);
    put("a", "images/\xC3\xA9.png", 3, 0644);
    put("a", "images.txt", 0, 0644);
    put("a", longer, 512, 0755);
    put("b", longer, 512, 0644);
    put("b", "images.txt", 0, 0600);
    put("b", "images/\xC3\xA9.png", 3, 0755);
    put("b", "images/0001.png", 70000, 0640);
    put("b", "transforms.json", 100, 0644);
    put("b", ".DS_Store", 10, 0644);
    put("b", "images/.hidden/x.png", 10, 0644);
    put("b", "__MACOSX/x.png", 10, 0644);
    measure("a", &a_length, a);
    measure("b", &b_length, b);
    CHECK(a_length == b_length);
    CHECK_STRING(b, a);
    put("b", "images/0002.png", 1, 0644);
    measure("b", &b_length, b);
    CHECK(strcmp(a, b) != 0);
}

/* This very hash is what a scene is called: a change of the format must be noticed. */
static void test_known_hash(void) {
    uint64_t length;
    char sha256[SHA256_HEX_SIZE];
    put("known", "b/2.txt", 4, 0644);
    put("known", "a.txt", 5, 0644);
    measure("known", &length, sha256);
    CHECK(length == 2 * 1024 + 1024);
    CHECK_STRING(sha256, "c99a664db1209ba963cb689b27291355eb8f973513cb08bb223650e0434aa055");
}

static void test_reads_back(void) {
    static const char *const wanted[] = {"images.txt", "images/0001.png", NULL, "images/\xC3\xA9.png",
                                         "transforms.json"};
    struct pack *p;
    struct error err;
    struct buf all;
    char *path = mem_printf("%s/a", root);
    CHECK(pack_open(&p, path, &err) == STATUS_OK);
    CHECK(pack_file_count(p) == 5 && pack_content_bytes(p) == 70615);
    buf_init(&all, 64 << 20);
    CHECK(drain(p, 65536, &all, &err) == STATUS_OK);
    struct archive *reader = archive_read_new();
    struct archive_entry *entry;
    archive_read_support_format_tar(reader);
    CHECK(archive_read_open_memory(reader, all.data, all.length) == ARCHIVE_OK);
    size_t count = 0;
    uint64_t bytes = 0;
    while (archive_read_next_header(reader, &entry) == ARCHIVE_OK) {
        if (count < 5 && wanted[count])
            CHECK_STRING(archive_entry_pathname(entry), wanted[count]);
        CHECK(archive_entry_mtime(entry) == 0 && archive_entry_uid(entry) == 0);
        CHECK(archive_entry_perm(entry) == 0644 && archive_entry_filetype(entry) == AE_IFREG);
        bytes += (uint64_t)archive_entry_size(entry);
        count++;
    }
    CHECK(count == 5 && bytes == 70615);
    archive_read_free(reader);
    buf_release(&all);
    pack_close(p);
    mem_free(path);
}

static enum status open_error(const char *name, struct error *err) {
    struct pack *p = NULL;
    char *path = mem_printf("%s/%s", root, name);
    enum status status = pack_open(&p, path, err);
    if (status == STATUS_OK)
        pack_close(p);
    mem_free(path);
    return status;
}

static void test_refusals(void) {
    struct error err;
    char *path = mem_printf("%s/empty", root);
    CHECK(mkdir(path, 0700) == 0);
    CHECK(open_error("empty", &err) == STATUS_INPUT && strstr(err.message, "holds no files"));
    CHECK(open_error("absent", &err) == STATUS_NOT_FOUND);
    mem_free(path);

    put("linked", "x.txt", 1, 0644);
    path = mem_printf("%s/linked/gone.png", root);
    CHECK(symlink("../absent.png", path) == 0);
    CHECK(open_error("linked", &err) == STATUS_NOT_FOUND && strstr(err.message, "gone.png") &&
          strstr(err.hint, "a link"));
    mem_free(path);

    put("loop", "x.txt", 1, 0644);
    path = mem_printf("%s/loop/again", root);
    CHECK(symlink(".", path) == 0);
    CHECK(open_error("loop", &err) == STATUS_INPUT && strstr(err.message, "deep"));
    mem_free(path);

    path = mem_printf("%s/known/pipe", root);
    CHECK(mkfifo(path, 0600) == 0);
    CHECK(open_error("known", &err) == STATUS_INPUT && strstr(err.message, "neither"));
    mem_free(path);
}

/* A link to a file is followed: what is sent is the file. */
static void test_links(void) {
    uint64_t length;
    char linked[SHA256_HEX_SIZE], plain[SHA256_HEX_SIZE];
    put("plain", "x.txt", 9, 0644);
    char *folder = mem_printf("%s/linked2", root), *link = mem_printf("%s/linked2/x.txt", root);
    CHECK(mkdir(folder, 0700) == 0 && symlink("../plain/x.txt", link) == 0);
    measure("plain", &length, plain);
    measure("linked2", &length, linked);
    CHECK_STRING(linked, plain);
    mem_free(folder);
    mem_free(link);
}

/* A file that shrinks between looking and reading cannot be padded with lies. */
static void test_shrinks(void) {
    struct pack *p;
    struct error err;
    struct buf all;
    char *folder = mem_printf("%s/shrinks", root), *path = mem_printf("%s/shrinks/x.bin", root);
    put("shrinks", "x.bin", 100000, 0644);
    CHECK(pack_open(&p, folder, &err) == STATUS_OK);
    CHECK(truncate(path, 1000) == 0);
    buf_init(&all, 1 << 20);
    CHECK(drain(p, 4096, &all, &err) == STATUS_CONFLICT);
    buf_release(&all);
    pack_close(p);
    mem_free(folder);
    mem_free(path);
}

/* An archive goes up as it is. */
static void test_file(void) {
    struct pack *p;
    struct error err;
    char *path = mem_printf("%s/archive/room.zip", root);
    char packed[SHA256_HEX_SIZE], direct[SHA256_HEX_SIZE];
    uint64_t length;
    put("archive", "room.zip", 200001, 0644);
    CHECK(pack_open(&p, path, &err) == STATUS_OK);
    CHECK(pack_measure(p, NULL, NULL, &length, packed, &err) == STATUS_OK);
    CHECK(sha256_of_file(path, direct, &err) == STATUS_OK);
    CHECK(length == 200001);
    CHECK_STRING(packed, direct);
    pack_close(p);
    mem_free(path);
}

int main(void) {
    if (!mkdtemp(root))
        return 1;
    test_same_bytes();
    test_known_hash();
    test_reads_back();
    test_refusals();
    test_links();
    test_shrinks();
    test_file();
    file_remove_tree(root, NULL);
    return check_result();
}
