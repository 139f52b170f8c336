/* Unpacking: what must come out of good archives, that nothing comes out of bad ones. The
 * hostile ones are made here with libarchive's writer; other projects' odd archives follow. */
#include "server/ingest/archive.h"

#include <archive.h>
#include <archive_entry.h>
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <locale.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/path.h"
#include "tests/check.h"

static char work[] = "/tmp/unbake-test-archive-XXXXXX";
static const struct archive_limits generous = {1000, (uint64_t)1 << 30, 1000.0};

static bool zstd_is_lacking;
int archive_read_support_filter_zstd(struct archive *a) {
    int (*call)(struct archive *);
    *(void **)&call = dlsym(RTLD_NEXT, "archive_read_support_filter_zstd");
    if (!zstd_is_lacking)
        return call(a);
    archive_set_error(a, -1, "Using external zstd program");
    return ARCHIVE_WARN;
}

struct item {
    const char *name;
    char kind;           /* 'f' file, 'd' folder, 'l' symbolic link, 'h' hard link, 'c' device */
    const char *content; /* or the link's target */
};

enum packing { ZIP, TAR, TAR_GZ, TAR_ZST };

/* Packs into WORK/NAME; the path is the caller's. */
static char *pack(const char *name, enum packing packing, const struct item *item, size_t count) {
    char *path = file_join(work, name);
    struct archive *a = archive_write_new();
    if (packing == ZIP)
        archive_write_set_format_zip(a);
    else
        archive_write_set_format_pax_restricted(a);
    if (packing == TAR_GZ)
        archive_write_add_filter_gzip(a);
    if (packing == TAR_ZST)
        archive_write_add_filter_zstd(a);
    CHECK(archive_write_open_filename(a, path) == ARCHIVE_OK);
    for (size_t i = 0; i < count; i++) {
        struct archive_entry *e = archive_entry_new();
        archive_entry_set_pathname(e, item[i].name);
        archive_entry_set_perm(e, 04777);
        archive_entry_set_filetype(e, item[i].kind == 'd'   ? AE_IFDIR
                                      : item[i].kind == 'l' ? AE_IFLNK
                                      : item[i].kind == 'c' ? AE_IFCHR
                                                            : AE_IFREG);
        size_t length = item[i].kind == 'f' ? strlen(item[i].content) : 0;
        if (item[i].kind == 'l')
            archive_entry_set_symlink(e, item[i].content);
        if (item[i].kind == 'h')
            archive_entry_set_hardlink(e, item[i].content);
        archive_entry_set_size(e, (la_int64_t)length);
        CHECK_THAT(archive_write_header(a, e) >= ARCHIVE_WARN, "%s: %s", item[i].name, archive_error_string(a));
        if (length > 0)
            CHECK(archive_write_data(a, item[i].content, length) == (la_ssize_t)length);
        archive_entry_free(e);
    }
    CHECK(archive_write_close(a) == ARCHIVE_OK);
    archive_write_free(a);
    return path;
}

static void check_content(const char *dir, const char *name, const char *wanted) {
    char *path = file_join(dir, name);
    struct buf content;
    buf_init(&content, 1 << 20);
    CHECK_THAT(file_read(path, &content, NULL) == STATUS_OK, "%s is missing", path);
    CHECK_STRING(buf_text(&content), wanted);
    struct stat info;
    CHECK(lstat(path, &info) == 0 && (info.st_mode & 07777 & ~0640u) == 0);
    buf_release(&content);
    mem_free(path);
}

static void test_good(void) {
    static const struct item items[] = {{"./", 'd', NULL},
                                        {"./room/", 'd', NULL},
                                        {"room/mesh.ply", 'f', "ply"},
                                        {"room/images/gr\xc3\xbc\xc3\x9f-\xe6\x97\xa5.png", 'f', "pixels"},
                                        {"room//a/./b", 'f', ""},
                                        {"__MACOSX/room/._mesh.ply", 'f', "litter"},
                                        {"room/.DS_Store", 'f', "litter"}};
    static const char *const names[] = {"good.zip", "good.tar", "good.tgz", "good.tzst"};
    for (enum packing p = ZIP; p <= TAR_ZST; p++) {
        setlocale(LC_CTYPE, "C.UTF-8"); /* for the writer; the code under test sees to itself */
        char *path = pack(names[p], p, items, sizeof items / sizeof *items);
        setlocale(LC_CTYPE, "C");
        char *dir = file_join(work, "out");
        struct error err = {.message = ""};
        CHECK_THAT(archive_unpack(path, names[p], dir, &generous, &err) == STATUS_OK, "%s", err.message);
        check_content(dir, "room/mesh.ply", "ply");
        check_content(dir, "room/images/gr\xc3\xbc\xc3\x9f-\xe6\x97\xa5.png", "pixels");
        check_content(dir, "room/a/b", "");
        char *litter = file_join(dir, "__MACOSX");
        CHECK(access(litter, F_OK) != 0);
        /* The folder must be new. */
        CHECK(archive_unpack(path, names[p], dir, &generous, &err) != STATUS_OK);
        check_content(dir, "room/mesh.ply", "ply");
        CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
        mem_free(litter);
        mem_free(dir);
        mem_free(path);
    }
}

static void refuse(const char *name, const char *path, const struct archive_limits *limits, enum status wanted,
                   const char *sentence) {
    char *dir = file_join(work, "refused");
    struct error err = {.message = ""};
    enum status status = archive_unpack(path, name, dir, limits, &err);
    CHECK_THAT(status == wanted, "%s: %s: %s", name, status_name(status), err.message);
    CHECK_THAT((status == STATUS_INTERNAL || strstr(err.message, name)) && strstr(err.message, sentence),
               "%s wants \"%s\": %s", name, sentence, err.message);
    CHECK_THAT(access(dir, F_OK) != 0, "%s left something", name);
    file_remove_tree(dir, NULL);
    mem_free(dir);
}

/* A colon is a drive's only before a slash; marks that messengers put into names are no harm. */
static void test_names(void) {
    static const char *const good[] = {"a:b", "c:", "a:b/c", "x/C:/y", "12:30/x.jpg", "\u200EIMG.jpg", "a\u00ADb"};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        char *clean = NULL;
        CHECK_THAT(path_clean(good[i], &clean, NULL) == STATUS_OK && strcmp(clean, good[i]) == 0, "%s", good[i]);
        mem_free(clean);
    }
}

static void test_hostile(void) {
    static const struct {
        const char *name;
        struct item item[3];
        const char *sentence;
    } table[] = {
        {"climb.tar", {{"a", 'f', "x"}, {"b/../../escaped", 'f', "x"}}, "\"..\""},
        {"climb2.zip", {{"..", 'd', NULL}}, "\"..\""},
        {"absolute.tar", {{"/tmp/unbake-escaped", 'f', "x"}}, "absolute"},
        {"drive.zip", {{"C:/x", 'f', "x"}}, "absolute"},
        {"backslash.tar", {{"..\\x", 'f', "x"}}, "backslash"},
        {"drive2.zip", {{"./c:/x", 'f', "x"}}, "absolute"},
        {"drive3.tar", {{"D:/", 'd', NULL}}, "absolute"},
        {"control.tar", {{"a\nb", 'f', "x"}}, "control character"},
        {"override.tar", {{"a\u202Egpj.exe", 'f', "x"}}, "\"a<U+202E>gpj.exe\" is a name with a control character"},
        {"symlink.tar", {{"a", 'l', "/etc"}, {"a/passwd", 'f', "x"}}, "symbolic link"},
        {"symlink.zip", {{"a", 'l', "/etc"}}, "symbolic link"},
        {"hardlink.tar", {{"a", 'f', "x"}, {"b", 'h', "a"}}, "hard link"},
        {"device.tar", {{"null", 'c', NULL}}, "device"},
        {"twice.tar", {{"a/b", 'f', "x"}, {"a//./b", 'f', "y"}}, "twice"},
        {"twice.zip", {{"a", 'f', "x"}, {"a", 'f', "y"}}, "twice"},
        {"both.tar", {{"a", 'f', "x"}, {"a/b", 'f', "y"}}, "both a file and a folder"},
        {"both2.tar", {{"a/b", 'f', "x"}, {"a", 'f', "y"}}, "twice"},
        {"folder.tar", {{"a/", 'd', NULL}}, "no files"},
        {"nameless.tar", {{"a", 'f', "x"}, {"./.", 'f', "x"}}, "entry 2 is a file without a name"},
    };
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        size_t count = 0;
        while (count < 3 && table[i].item[count].name)
            count++;
        size_t length = strlen(table[i].name);
        char *path =
            pack(table[i].name, strcmp(table[i].name + length - 3, "zip") == 0 ? ZIP : TAR, table[i].item, count);
        refuse(table[i].name, path, &generous, STATUS_INPUT, table[i].sentence);
        mem_free(path);
    }
    CHECK(access("/tmp/unbake-escaped", F_OK) != 0);
    char *deep = mem_alloc(200);
    memset(deep, 0, 200);
    for (int i = 0; i < 40; i++)
        strcat(deep, "d/");
    strcat(deep, "f");
    struct item item = {deep, 'f', "x"};
    char *path = pack("deep.tar", TAR, &item, 1);
    refuse("deep.tar", path, &generous, STATUS_INPUT, "too deep");
    mem_free(deep);
    mem_free(path);
    refuse("nowhere.tar", "/nowhere.tar", &generous, STATUS_NOT_FOUND, "cannot open");
}

/* As where the library was built without zstd, and knows the program only. */
static void test_library(void) {
    struct item item = {"a", 'f', "x"};
    char *path = pack("plain.tar", TAR, &item, 1), *dir = file_join(work, "out");
    zstd_is_lacking = true;
    refuse("plain.tar", path, &generous, STATUS_INTERNAL, "lacks zip, tar or zstd: Using external zstd program");
    zstd_is_lacking = false;
    CHECK(archive_unpack(path, "plain.tar", dir, &generous, NULL) == STATUS_OK);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    mem_free(dir);
    mem_free(path);
}

static void write_file(const char *path, const void *data, size_t length) {
    CHECK(file_replace(path, data, length, NULL) == STATUS_OK);
}

static void test_damage(void) {
    char *path = file_join(work, "bad");
    write_file(path, "", 0);
    refuse("bad", path, &generous, STATUS_INPUT, "bad");
    static const char picture[] = "\x89PNG\r\n\x1a\n and so on, no archive at all";
    write_file(path, picture, sizeof picture);
    refuse("bad", path, &generous, STATUS_INPUT, "cannot be read as a zip, tar");
    static char big[300000];
    for (size_t i = 0; i + 1 < sizeof big; i++)
        big[i] = (char)('a' + (i * i / 7) % 26);
    struct item item = {"a", 'f', big};
    for (enum packing p = ZIP; p <= TAR_ZST; p++) {
        char *whole = pack("whole", p, &item, 1);
        struct buf content;
        buf_init(&content, 1 << 22);
        CHECK(file_read(whole, &content, NULL) == STATUS_OK);
        size_t length = content.length;
        write_file(path, content.data, p == TAR ? 100000 : length / 2);
        refuse("bad", path, &generous, STATUS_INPUT, "bad");
        if (p != TAR) { /* plain tar has no checksum of its content */
            content.data[length / 2] ^= 0x55;
            content.data[length / 2 + 1] ^= 0x55;
            write_file(path, content.data, length);
            refuse("bad", path, &generous, STATUS_INPUT, p == TAR_ZST ? "corruption" : "damaged");
        }
        buf_release(&content);
        mem_free(whole);
    }
    mem_free(path);
}

static void test_limits(void) {
    static const struct item items[] = {{"a", 'f', "12345"}, {"b", 'f', "67890"}, {"c", 'f', "x"}};
    char *path = pack("limits.tar", TAR, items, 3);
    refuse("limits.tar", path, &(struct archive_limits){2, 1000, 100.0}, STATUS_LIMIT, "more than 2 files");
    /* By the headers, before anything is made: there is no place for it here. */
    struct error err;
    static const struct archive_limits two = {2, 1000, 100.0};
    CHECK(archive_unpack(path, "limits.tar", "/nowhere/at/all", &two, &err) == STATUS_LIMIT);
    CHECK_THAT(strstr(err.message, "more than 2 files"), "%s", err.message);
    refuse("limits.tar", path, &(struct archive_limits){9, 9, 100.0}, STATUS_LIMIT, "more than 9 bytes");
    refuse("limits.tar", path, &(struct archive_limits){9, 4, 100.0}, STATUS_LIMIT, "says it is 5 bytes");
    mem_free(path);
    /* A bomb: 300 MiB of zeros. */
    path = file_join(work, "bomb.tzst");
    struct archive *a = archive_write_new();
    archive_write_set_format_pax_restricted(a);
    archive_write_add_filter_zstd(a);
    CHECK(archive_write_open_filename(a, path) == ARCHIVE_OK);
    struct archive_entry *e = archive_entry_new();
    archive_entry_set_pathname(e, "zeros");
    archive_entry_set_filetype(e, AE_IFREG);
    archive_entry_set_size(e, (la_int64_t)300 << 20);
    CHECK(archive_write_header(a, e) == ARCHIVE_OK);
    static const char zeros[1 << 20];
    for (int i = 0; i < 300; i++)
        archive_write_data(a, zeros, sizeof zeros);
    archive_entry_free(e);
    CHECK(archive_write_close(a) == ARCHIVE_OK);
    archive_write_free(a);
    refuse("bomb.tzst", path, &generous, STATUS_LIMIT, "1000 times its size");
    mem_free(path);
}

/* A full disk, in a file system of 64 KiB of its own; skipped where that may not be mounted. */
static void test_full_disk(void) {
    static char big[200000];
    memset(big, 'x', sizeof big - 1);
    struct item item = {"big", 'f', big};
    char *path = pack("big.tar", TAR, &item, 1), *mount_point = file_join(work, "disk");
    CHECK(mkdir(mount_point, 0700) == 0);
    pid_t child = fork();
    if (child == 0) {
        if ((unshare(CLONE_NEWNS) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) ||
            mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0 ||
            mount("tmpfs", mount_point, "tmpfs", 0, "size=64k") != 0)
            _exit(77);
        char *dir = file_join(mount_point, "out");
        struct error err = {.message = ""};
        enum status status = archive_unpack(path, "big.tar", dir, &generous, &err);
        _exit(status == STATUS_NO_SPACE && access(dir, F_OK) != 0 ? 0 : 1);
    }
    int state = 0;
    CHECK(waitpid(child, &state, 0) == child && WIFEXITED(state));
    if (WEXITSTATUS(state) == 77)
        printf("no mount allowed: the full disk was not tried\n");
    else
        CHECK(WEXITSTATUS(state) == 0);
    mem_free(path);
    mem_free(mount_point);
}

/* Every file of a folder of odd archives: unpacked whole or refused, and no link inside. */
static void check_tree(const char *dir) {
    DIR *d = opendir(dir);
    CHECK(d != NULL);
    struct dirent *entry;
    while (d && (entry = readdir(d)) != NULL) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        char *inner = file_join(dir, entry->d_name);
        struct stat info;
        CHECK(lstat(inner, &info) == 0 && (S_ISREG(info.st_mode) || S_ISDIR(info.st_mode)));
        if (S_ISDIR(info.st_mode))
            check_tree(inner);
        mem_free(inner);
    }
    if (d)
        closedir(d);
}

static size_t run_vectors(const char *folder) {
    DIR *d = opendir(folder);
    struct dirent *entry;
    size_t unpacked = 0;
    static const struct archive_limits limits = {20000, 64 << 20, 1000.0};
    while (d && (entry = readdir(d)) != NULL) {
        if (entry->d_name[0] == '.')
            continue;
        char *path = file_join(folder, entry->d_name), *dir = file_join(work, "vector");
        struct error err = {.message = ""};
        enum status status = archive_unpack(path, entry->d_name, dir, &limits, &err);
        printf("%-50s %s\n", entry->d_name, status == STATUS_OK ? "unpacked" : err.message);
        if (status == STATUS_OK) {
            unpacked++;
            check_tree(dir);
        } else {
            CHECK_THAT(status == STATUS_INPUT || status == STATUS_LIMIT, "%s: %s", entry->d_name, err.message);
            CHECK(strstr(err.message, entry->d_name) != NULL);
            CHECK(access(dir, F_OK) != 0);
        }
        CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
        mem_free(path);
        mem_free(dir);
    }
    if (d)
        closedir(d);
    return unpacked;
}

int main(void) {
    CHECK(mkdtemp(work) != NULL);
    test_good();
    test_names();
    test_hostile();
    test_damage();
    test_limits();
    test_library();
    test_full_disk();
    const char *root = getenv("UNBAKE_TEST_DATA");
    char *tar = mem_printf("%s/vectors/tar/tests/archives", root ? root : "../shared/data");
    char *zip = mem_printf("%s/vectors/zip", root ? root : "../shared/data");
    if (access(tar, R_OK) == 0) {
        CHECK(run_vectors(tar) >= 10);
        CHECK(run_vectors(zip) >= 50);
    } else {
        printf("no vectors here\n");
    }
    mem_free(tar);
    mem_free(zip);
    file_remove_tree(work, NULL);
    return check_result();
}
