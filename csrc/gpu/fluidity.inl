/* The threads of the diffusion of the fluidity (mpm/device.h): those of the kernels in double precision, for others as well. */
#define GR_FLUIDITY_THREAD GR_PASTE(gr_fluidity_thread_, GR_ISA)
void GR_FLUIDITY_THREAD(const struct gr_launch *launch, enum gr_device_stage stage, int64_t i);

#ifdef GR_SINGLE
#define GR_CALL_FLUIDITY GR_FLUIDITY_THREAD
#else

/* True if a pass belongs to a search that has ended already (has_ended in fluidity/diffuse.c). */
static int is_late(const struct gr_diffusion_work *w)
{
    const int of_search = w->which == GR_PASS_multiply || w->which == GR_PASS_descend || w->which == GR_PASS_turn;
    return of_search && w->f->descent.ended;
}

/* Sums of the products of the cells that have number i % GR_PAGE in the pages of chunk i/GR_PAGE. */
static void sum_products(const struct gr_launch *launch, int64_t i)
{
    const struct gr_diffusion_work *w = &launch->diffusion;
    const int64_t *first = w->f->pages.chunk_first + i / GR_PAGE;
    vd sum[2] = {v_zero(), v_zero()};
    for (int64_t q = first[0]; q < first[1]; q++) add_products(w->which, w, q * GR_PAGE + i % GR_PAGE, sum);
    for (int s = 0; s < gr_sums_of_pass(w->which); s++) launch->e->device->products[s][i] = sum[s][0];
}

/* The sums of a group of chunks: of a chunk as store_sums has it. */
static void sum_chunks(const struct gr_launch *launch, int64_t i)
{
    const struct gr_diffusion_work *w = &launch->diffusion;
    const struct gr_device *d = launch->e->device;
    const int64_t n = w->f->pages.n_chunks, last = (i + 1) * GR_GROUP < n ? (i + 1) * GR_GROUP : n;
    const int more = w->which == GR_PASS_multiply && w->f->pages.n_wraps;
    for (int s = 0; s < gr_sums_of_pass(w->which); s++) {
        struct gr_exact sum = {.nan = 0};
        for (int64_t c = i * GR_GROUP; c < last; c++) {
            double total = 0;
            for (int k = 0; k < GR_PAGE; k++) total += d->products[s][c * GR_PAGE + k];
            gr_exact_add(&sum, more ? total + w->f->space.partial[s][c] : total);
        }
        d->exact[2 * i + s] = sum;
    }
}

/* The sums of all chunks, with which the pass ends. */
static void sum_groups(const struct gr_launch *launch)
{
    const struct gr_diffusion_work *w = &launch->diffusion;
    const struct gr_device *d = launch->e->device;
    const int64_t groups = gr_groups_of(w->f->pages.n_chunks);
    double sum[2] = {0, 0};
    for (int s = 0; s < gr_sums_of_pass(w->which); s++) {
        struct gr_exact all = {.nan = 0};
        for (int64_t g = 0; g < groups; g++) gr_exact_join(&all, &d->exact[2 * g + s]);
        sum[s] = gr_exact_value(&all);
    }
    gr_end_pass(w->f, w->which, sum);
}

static void add_wraps_of_chunk(const struct gr_diffusion_work *w, int64_t chunk)
{
    const double product = add_wraps(w->which, w, chunk);
    if (w->which == GR_PASS_multiply) w->f->space.partial[0][chunk] = product;
}

static void end_cell(const struct gr_diffusion_work *w, int64_t place)
{
    const int clamped = end_cells(w->which, w, place);
    if (clamped) __atomic_fetch_add(&w->f->clamped, clamped, __ATOMIC_RELAXED);
}

GR_INLINE void fluidity_thread(const struct gr_launch *launch, const enum gr_device_stage stage, int64_t i)
{
    const struct gr_diffusion_work *w = &launch->diffusion;
    const int lane = (int)(i % GR_PAGE);
    if (is_late(w)) return;
    switch (stage) {
    case GR_STAGE_link_cells:
        link_cells(w->f->n_links, w->f, i / GR_PAGE, lane, lane + 1);
        break;
    case GR_STAGE_link_wraps:
        link_wraps(w->f, i);
        break;
    case GR_STAGE_begin_cells:
        begin_cells(w->which, w->f->n_links, w, i);
        break;
    case GR_STAGE_wraps:
        add_wraps_of_chunk(w, i);
        break;
    case GR_STAGE_end_cells:
        end_cell(w, i);
        break;
    case GR_STAGE_products:
        sum_products(launch, i);
        break;
    case GR_STAGE_sums:
        sum_chunks(launch, i);
        break;
    default:
        sum_groups(launch);
    }
}

void GR_FLUIDITY_THREAD(const struct gr_launch *launch, enum gr_device_stage stage, int64_t i)
{
    fluidity_thread(launch, stage, i);
}
#define GR_CALL_FLUIDITY fluidity_thread
#endif

#define GR_X(stage, unit) \
    static void thread_##stage(const struct gr_launch *launch, int64_t i) { GR_CALL_FLUIDITY(launch, GR_STAGE_##stage, i); }
GR_FLUIDITY_STAGES(GR_X)
#undef GR_X

static void thread_mean_pairs(const struct gr_launch *launch, int64_t i) { mean_pairs(launch->e, i, i + 1); }

static void thread_store_pairs(const struct gr_launch *launch, int64_t i) { store_pairs(launch->e, i, i + 1); }

static void thread_begin_substeps(const struct gr_launch *launch, int64_t i)
{
    begin_substeps_of(launch->e, i / GR_LANES, i / GR_LANES + 1, part_of(i));
}

static void thread_substep(const struct gr_launch *launch, int64_t i)
{
    substep_of(launch->e, i / GR_LANES, i / GR_LANES + 1, part_of(i));
}
