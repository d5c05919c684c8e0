/* Forces of three motions, and calls that are wrong: `batch FILE WRONG_FILE HOME`, HOME six numbers. Prints a line for each. */
#include <hexad.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { ROWS = 3 };

static double x[ROWS][6], x_rate[ROWS][6], x_accel[ROWS][6], forces[ROWS][6];

static void call(const struct hexad_machine *machine, const char *fidelity, size_t count, const double *from, double *to)
{
    enum hexad_result result =
        hexad_inverse_dynamics_batch(machine, fidelity, count, from, x_rate[0], x_accel[0], to, 2);
    printf("%d %s\n", result, result == HEXAD_OK ? "ok" : hexad_last_error());
}

static void open_wrong(const char *path)
{
    printf("%d %s\n", hexad_open_machine(path) == NULL, hexad_last_error());
}

int main(int count, char **arguments)
{
    struct hexad_machine *machine = hexad_open_machine(count == 9 ? arguments[1] : NULL);
    if (machine == NULL)
        return fprintf(stderr, "%s\n", hexad_last_error()), 1;
    for (int row = 0; row < ROWS; row++)
        for (int k = 0; k < 6; k++)
            x[row][k] = atof(arguments[3 + k]);
    x_accel[1][2] = NAN;
    x_accel[2][5] = 1.0;
    call(machine, "exact", ROWS, x[0], forces[0]);
    for (int row = 0; row < ROWS; row++)
        for (int k = 0; k < 6; k++)
            printf("%.17g%s", forces[row][k], k < 5 ? " " : "\n");

    call(machine, "gravity", 0, NULL, NULL);
    call(NULL, "exact", ROWS, x[0], forces[0]);
    call(machine, "best", ROWS, x[0], forces[0]);
    call(machine, NULL, ROWS, x[0], forces[0]);
    call(machine, "exact", ROWS, NULL, forces[0]);
    call(machine, "exact", ROWS, x[0], NULL);
    call(machine, "exact", ROWS, x[0], x[1]);
    call(machine, "exact", ROWS, (const double *)((const char *)x + 4), forces[0]);
    call(machine, "exact", (size_t)-1, x[0], forces[0]);
    open_wrong(NULL);
    open_wrong("nowhere.toml");
    open_wrong(arguments[2]);
    printf("%d %d\n", hexad_close_machine(machine), hexad_close_machine(NULL));
    return 0;
}
