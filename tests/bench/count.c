/** @file
 *  A plugin for QEMU's translator: instructions retired by every call of some functions, exactly, with all that they call.
 *
 *      -plugin count.so,functions=FILE,calls=FILE
 *
 *  functions: a line for every function of the program, `BEGIN END COUNTED`, the first two in hexadecimal, END exclusive, COUNTED 0 or 1; the line's
 *  number from 0 on is its index. A function is entered where its first instruction runs and the one before was not its own, and left
 *  where the instruction behind the call runs. A call that is a jump at the end of another function is left together with that one. There
 *  must be no recursion: it is not told from a loop.
 *  calls: a line a call of those that are counted, in the order in which they end: index, depth (0: none of them is around it), instructions with
 *  those of all callees, and instructions without those of counted callees. So what is not counted counts for who has called it.
 *  Instructions are not cycles: a processor with a cache, a bus or a pipeline takes more, and how many is not said here.
 *  Debian ships no qemu-plugin.h; the declarations below are those of its stable interface, version 1. */

#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- QEMU's interface ---- */

typedef uint64_t qemu_plugin_id_t;
typedef struct qemu_info_t qemu_info_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
typedef void (*qemu_plugin_vcpu_tb_trans_cb_t)(qemu_plugin_id_t id, struct qemu_plugin_tb *tb);
typedef void (*qemu_plugin_vcpu_udata_cb_t)(unsigned int vcpu, void *user);
typedef void (*qemu_plugin_udata_cb_t)(qemu_plugin_id_t id, void *user);
#define QEMU_PLUGIN_CB_NO_REGS 0

extern void                     qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id, qemu_plugin_vcpu_tb_trans_cb_t cb);
extern void                     qemu_plugin_register_vcpu_tb_exec_cb(struct qemu_plugin_tb *tb, qemu_plugin_vcpu_udata_cb_t cb, int flags, void *user);
extern void                     qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, qemu_plugin_udata_cb_t cb, void *user);
extern size_t                   qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
extern struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb, size_t place);
extern uint64_t                 qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *insn);
extern size_t                   qemu_plugin_insn_size(const struct qemu_plugin_insn *insn);

extern int qemu_plugin_version;
extern int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int argc, char **argv);
int        qemu_plugin_version = 1;

/* ---- counting ---- */

#define FUNCTIONS_MAX 4096
#define DEPTH_MAX 64
#define PAGE 4096U
#define LONGEST 15U /* bytes of an instruction */
#define NOWHERE UINT64_MAX

typedef struct {
    uint64_t begin;
    uint64_t end;
    int      counted;
} function;

typedef struct {
    int      index;
    uint64_t back;   /* where its caller goes on */
    uint64_t at;     /* instructions before its first */
    uint64_t inside; /* of them, those of listed callees that have ended */
} call;

typedef struct {     /* a piece of code that runs from its first instruction to its last */
    uint64_t begin;
    uint64_t end;
    uint64_t instructions;
    uint64_t doubted; /* where its last instruction begins, if that may not be part of it; or nowhere */
    int      entered; /* index of the function whose first instruction this is, or -1 */
} piece;

static function functions[FUNCTIONS_MAX];
static int      count;
static call     stack[DEPTH_MAX];
static int      depth;
static int      around; /* of them, those that are counted */
static uint64_t retired;
static uint64_t last_begin, last_end, last_doubted = NOWHERE; /* of the piece that ran before */
static FILE    *calls;

static void fail(const char *what)
{
    (void)fprintf(stderr, "count: %s\n", what);
    exit(EXIT_FAILURE);
}

static void leave(void)
{
    depth--;
    const call *const ended = &stack[depth];
    const uint64_t all = retired - ended->at;
    const bool counted = functions[ended->index].counted != 0;
    if (counted) {
        around--;
        (void)fprintf(calls, "%d %d %" PRIu64 " %" PRIu64 "\n", ended->index, around, all, all - ended->inside);
    }
    if (depth > 0) {
        stack[depth - 1].inside += counted ? all : ended->inside;
    }
}

static void enter(int index)
{
    const function *const f = &functions[index];
    const bool loops = (last_begin >= f->begin) && (last_begin < f->end);
    if (!loops) {
        if (depth == DEPTH_MAX) {
            fail("calls are nested too deeply");
        }
        stack[depth] = (call){.index = index, .back = last_end, .at = retired};
        depth++;
        around += (f->counted != 0) ? 1 : 0;
    }
}

/* Frames above the one that is returned from ended in the same jump. */
static void look_for_return(uint64_t address)
{
    int i = depth - 1;
    while ((i >= 0) && (stack[i].back != address)) {
        i--;
    }
    while ((i >= 0) && (depth > i)) {
        leave();
    }
}

static void on_piece(unsigned int vcpu, void *user)
{
    const piece *const p = user;
    (void)vcpu;
    if (p->begin == last_doubted) { /* it was not: it begins this piece */
        retired--;
        last_end = last_doubted;
    }
    if (p->entered >= 0) {
        enter(p->entered); /* nobody returns to here, though the jump that ends the function before may look like a call from just before here */
    } else {
        look_for_return(p->begin);
    }
    last_begin = p->begin;
    last_end = p->end;
    last_doubted = p->doubted;
    retired += p->instructions;
}

/* A translator ends a piece before an instruction that lies in two pages, and x86's of QEMU 7.2 lists it all the same: the next piece begins with it. */
static void on_translation(qemu_plugin_id_t id, struct qemu_plugin_tb *tb)
{
    const size_t n = qemu_plugin_tb_n_insns(tb);
    const struct qemu_plugin_insn *const last = qemu_plugin_tb_get_insn(tb, n - 1U);
    piece *const p = malloc(sizeof(*p)); /* lives as long as the emulator */
    (void)id;
    if (p == NULL) {
        fail("no memory");
    }
    *p = (piece){.begin = qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(tb, 0U)), .instructions = n, .entered = -1};
    p->end = qemu_plugin_insn_vaddr(last) + qemu_plugin_insn_size(last);
    const uint64_t from = qemu_plugin_insn_vaddr(last);
    p->doubted = ((n > 1U) && ((from / PAGE) != ((from + LONGEST) / PAGE))) ? from : NOWHERE;
    for (int i = 0; i < count; i++) {
        if (functions[i].begin == p->begin) {
            p->entered = i;
        }
    }
    qemu_plugin_register_vcpu_tb_exec_cb(tb, on_piece, QEMU_PLUGIN_CB_NO_REGS, p);
}

static void on_exit(qemu_plugin_id_t id, void *user)
{
    (void)id;
    (void)user;
    if (fclose(calls) != 0) {
        fail("calls cannot be written");
    }
}

static void read_functions(const char *path)
{
    FILE *const file = fopen(path, "r");
    if (file == NULL) {
        fail("functions cannot be read");
    }
    function *f = functions;
    while ((count < FUNCTIONS_MAX) && (fscanf(file, "%" SCNx64 " %" SCNx64 " %d", &f->begin, &f->end, &f->counted) == 3)) {
        count++;
        f++;
    }
    if ((!feof(file)) || (count == 0)) {
        fail("functions: no list, or too long a one");
    }
    (void)fclose(file);
}

int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int argc, char **argv)
{
    static const char list[] = "functions=";
    static const char out[] = "calls=";
    (void)info;
    for (int i = 0; i < argc; i++) {
        if (strncmp(argv[i], list, sizeof(list) - 1U) == 0) {
            read_functions(&argv[i][sizeof(list) - 1U]);
        } else if (strncmp(argv[i], out, sizeof(out) - 1U) == 0) {
            calls = fopen(&argv[i][sizeof(out) - 1U], "w");
        } else {
            fail("unknown argument");
        }
    }
    if ((count == 0) || (calls == NULL)) {
        fail("needs functions=FILE and calls=FILE");
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translation);
    qemu_plugin_register_atexit_cb(id, on_exit, NULL);
    return 0;
}
