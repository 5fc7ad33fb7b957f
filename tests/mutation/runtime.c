/** @file
 *  A test program is started once and forks for each mutant: before its main() this reads the list of mutants. It answers with a line for each.
 *      HG_MUTANTS=FILE   numbers, one a line; HG_VERDICTS=FILE  "number k|s" is written there: killed or survived
 *      HG_LIMIT_US=..    processor time that a mutant may take
 *      HG_REACHED=FILE   instead: run without a mutant, write the numbers that were come by */
#include "runtime.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#define MUTANTS_MAX 65536U

unsigned hg_mutant;
unsigned char *hg_reached;

static void write_reached(void)
{
    FILE *out = fopen(getenv("HG_REACHED"), "w");
    for (unsigned i = 0U; (out != NULL) && (i < MUTANTS_MAX); i++) {
        if (hg_reached[i] != 0U) {
            (void)fprintf(out, "%u\n", i);
        }
    }
    if (out == NULL || fclose(out) != 0) {
        abort();
    }
}

/* In the child: its output goes nowhere, its time is limited (the processor's, so that a busy machine kills nobody; and the clock's, for who waits). */
static void become(unsigned number, long limit_us)
{
    const struct itimerval cpu = {.it_value = {.tv_sec = limit_us / 1000000, .tv_usec = limit_us % 1000000}};
    const struct itimerval wall = {.it_value = {.tv_sec = 60 + (20 * (limit_us / 1000000))}};
    const struct rlimit none = {0, 0};
    const int nowhere = open("/dev/null", O_RDWR);
    (void)dup2(nowhere, 1);
    (void)dup2(nowhere, 2);
    (void)setrlimit(RLIMIT_CORE, &none);
    (void)setitimer(ITIMER_PROF, &cpu, NULL);
    (void)setitimer(ITIMER_REAL, &wall, NULL);
    hg_mutant = number;
}

__attribute__((constructor)) static void serve(void)
{
    const char *list = getenv("HG_MUTANTS");
    if (getenv("HG_REACHED") != NULL) {
        hg_reached = calloc(MUTANTS_MAX, 1U);
        (void)atexit(write_reached);
        return;
    }
    if (list == NULL) {
        return;
    }
    FILE *in = fopen(list, "r");
    FILE *out = fopen(getenv("HG_VERDICTS"), "w");
    const long limit = atol(getenv("HG_LIMIT_US"));
    unsigned number = 0U;
    while ((in != NULL) && (out != NULL) && (fscanf(in, "%u", &number) == 1)) {
        (void)fflush(out);
        const pid_t child = fork();
        if (child == 0) {
            (void)close(fileno(in)); /* not fclose(): it would move what the parent reads */
            become(number, limit);
            return;
        }
        int status = 1;
        if ((child < 0) || (waitpid(child, &status, 0) != child)) {
            abort();
        }
        (void)fprintf(out, "%u %c\n", number, (status == 0) ? 's' : 'k');
    }
    _exit(((out != NULL) && (fclose(out) == 0)) ? 0 : 1);
}
