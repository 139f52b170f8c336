/* xml.c -- see xml.h. Expat refuses entities that blow up (since 2.4). */
#include "server/ingest/source/xml.h"

#include <expat.h>
#include <stdbool.h>
#include <string.h>

#include "common/mem.h"

#define BLANKS " \t\r\n"

struct reader {
    XML_Parser parser;
    struct xml_node *root, *at; /* at: the open element */
    size_t depth;
    bool is_too_deep;
};

static void XMLCALL begin(void *user, const XML_Char *name, const XML_Char **attribute) {
    struct reader *r = user;
    size_t count = 0;
    if (++r->depth > XML_MAX_DEPTH) {
        r->is_too_deep = true;
        XML_StopParser(r->parser, XML_FALSE);
        return;
    }
    struct xml_node *node = mem_calloc(1, sizeof *node);
    node->name = mem_strdup(name);
    node->text = mem_strdup("");
    while (attribute[count])
        count++;
    node->attribute = mem_calloc(count + 1, sizeof *node->attribute);
    for (size_t i = 0; i < count; i++)
        node->attribute[i] = mem_strdup(attribute[i]);
    node->parent = r->at;
    if (!r->at)
        r->root = node;
    else if (r->at->last)
        r->at->last->next = node;
    else
        r->at->first = node;
    if (r->at)
        r->at->last = node;
    r->at = node;
}

static void XMLCALL end(void *user, const XML_Char *name) {
    struct reader *r = user;
    (void)name;
    char *text = r->at->text, *from = text + strspn(text, BLANKS);
    size_t length = r->at->text_length - (size_t)(from - text);
    while (length > 0 && strchr(BLANKS, from[length - 1]))
        length--;
    memmove(text, from, length);
    text[length] = '\0';
    r->at->text_length = length;
    r->at = r->at->parent;
    r->depth--;
}

static bool is_blank(const char *piece, int length) {
    for (int i = 0; i < length; i++)
        if (!strchr(BLANKS, piece[i]))
            return false;
    return true;
}

/* Comes in pieces, of which elements that hold more than line breaks have few. */
static void XMLCALL add_text(void *user, const XML_Char *piece, int length) {
    struct xml_node *node = ((struct reader *)user)->at;
    size_t used = node->text_length;
    if (used == 0 && is_blank(piece, length))
        return;
    node->text_length += (size_t)length;
    node->text = mem_realloc_array(node->text, node->text_length + 1, 1);
    memcpy(node->text + used, piece, (size_t)length);
    node->text[node->text_length] = '\0';
}

/* Expat 2.9 deprecates the call whose result is as wide as a long. */
static unsigned long long line_of(XML_Parser parser) {
#if XML_MAJOR_VERSION > 2 || XML_MINOR_VERSION >= 9
    return XML_GetCurrentLineNumber64(parser);
#else
    return XML_GetCurrentLineNumber(parser);
#endif
}

enum status xml_parse(const char *text, size_t size, const char *name, struct xml_node **root, struct error *err) {
    struct reader r = {.parser = XML_ParserCreate(NULL)};
    enum status status = STATUS_OK;
    *root = NULL;
    if (!r.parser)
        mem_exhausted("Expat");
    XML_SetUserData(r.parser, &r);
    XML_SetElementHandler(r.parser, begin, end);
    XML_SetCharacterDataHandler(r.parser, add_text);
    if (size > XML_MAX_BYTES)
        status = error_set(err, STATUS_LIMIT, "%s is larger than %d bytes", name, XML_MAX_BYTES);
    else if (XML_Parse(r.parser, text, (int)size, XML_TRUE) != XML_STATUS_OK)
        status =
            error_set(err, STATUS_INPUT, "%s, line %llu: %s", name, line_of(r.parser),
                      r.is_too_deep ? "elements are nested too deep" : XML_ErrorString(XML_GetErrorCode(r.parser)));
    XML_ParserFree(r.parser);
    if (status == STATUS_OK)
        *root = r.root;
    else
        xml_free(r.root);
    return status;
}

const char *xml_library_version(void) { return XML_ExpatVersion(); }

void xml_free(struct xml_node *node) {
    while (node) {
        struct xml_node *next = node->next;
        xml_free(node->first);
        for (size_t i = 0; node->attribute[i]; i++)
            mem_free(node->attribute[i]);
        mem_free(node->attribute);
        mem_free(node->name);
        mem_free(node->text);
        mem_free(node);
        node = next;
    }
}

static struct xml_node *of_name(struct xml_node *node, const char *name) {
    while (node && strcmp(node->name, name) != 0)
        node = node->next;
    return node;
}

struct xml_node *xml_child(const struct xml_node *node, const char *name) {
    return node ? of_name(node->first, name) : NULL;
}

struct xml_node *xml_next(const struct xml_node *after, const char *name) {
    return of_name(after->next, name);
}

struct xml_node *xml_find(struct xml_node *node, const char *name) {
    if (!node || strcmp(node->name, name) == 0)
        return node;
    for (struct xml_node *child = node->first; child; child = child->next) {
        struct xml_node *found = xml_find(child, name);
        if (found)
            return found;
    }
    return NULL;
}

const char *xml_attribute(const struct xml_node *node, const char *name) {
    for (size_t i = 0; node && node->attribute[i]; i += 2)
        if (strcmp(node->attribute[i], name) == 0)
            return node->attribute[i + 1];
    return NULL;
}
