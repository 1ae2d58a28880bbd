/* Tests of mpm/spread.c: against marks in arrays of the whole grid. */
#include "mpm/spread.h"
#include "core/memory.h"

#include <string.h>

#include "tests/check.h"
#include "tests/scene.h"

enum { CELLS = 7 * 7 * 7, NODES = 9 * 9 * 9, CHUNKS = 5 };

struct task {
    struct gr_engine *e;
    enum gr_spread what;
    int64_t n, cells[CELLS];
};

/* Mark the indices to which the cells lead, one after the other. */
static void mark(const struct task *task, uint8_t *marks)
{
    const struct gr_engine *e = task->e;
    const int dim = e->config.dim, width = task->what == GR_SPREAD_NODES ? gr_basis_nodes_1d(e->config.basis) : 3;
    memset(marks, 0, NODES);
    for (int64_t k = 0; k < task->n; k++)
        for (int a = 0; a < (dim == 2 ? width * width : width * width * width); a++) {
            const int part[3] = {a % width, a / width % width, a / (width * width)};
            int64_t rest = task->cells[k], index = 0, stride = 1, inside = 1;
            for (int d = 0; d < dim; d++) {
                const struct gr_axis *axis = &e->axis[d];
                const int64_t at = rest % axis->n_cells;
                int64_t to = at + part[d] - 1, all = axis->n_cells;
                if (task->what == GR_SPREAD_NODES)
                    to = axis->cell[at].node[part[d]], all = axis->n_nodes;
                else if (axis->periodic)
                    to = (to + all) % all;
                inside &= to >= 0 && to < all;
                index += to * stride;
                stride *= all;
                rest /= axis->n_cells;
            }
            if (inside) marks[index] = 1;
        }
}

static void compare(void *context, struct gr_team *team)
{
    static uint8_t marks[NODES];
    const struct task *task = context;
    int64_t *out = 0, n, expected = 0, wrong = 0;
    mark(task, marks);
    CHECK(gr_spread(task->e, task->what, task->cells, task->n, team, CHUNKS, &out, &n) == GR_OK);
    for (int64_t i = 0; i < NODES; i++)
        if (marks[i]) wrong += expected >= n || out[expected] != i, expected++;
    CHECK(n == expected && !wrong);
    gr_free(out);
}

TEST(as_one_by_one)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
            for (int periodic = 0; periodic < 2; periodic++) {
                static const int32_t line = 3;
                struct scene s;
                scene_default(&s, dim, basis, GR_AFFINE_NONE, 0);
                for (int d = 0; d < dim; d++) s.config.periodic[d] = periodic;
                if (!periodic && basis != GR_UGIMP) s.config.n_c0_lines[0] = 1, s.config.c0_lines[0] = &line;
                CHECK(scene_build(&s, 0, 0.1, 0.9) == GR_OK);
                const struct gr_axis *axis = s.engine->axis;
                const int64_t all = axis[0].n_cells * axis[1].n_cells * (dim == 3 ? axis[2].n_cells : 1);
                for (int round = 0; round < 12; round++) {
                    struct task task = {.e = s.engine, .what = round % 2 ? GR_SPREAD_NODES : GR_SPREAD_CELLS};
                    const double share = round < 2 ? 0 : 0.02 * round * round; /* none, few, all of the cells */
                    for (int64_t c = 0; c < all; c++)
                        if (scene_random(0, 1) < share) task.cells[task.n++] = c;
                    gr_team_lead(1 + round % 3, compare, &task);
                }
                scene_free(&s);
            }
}
