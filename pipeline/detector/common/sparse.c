/* Sparse convolution in float32 on one CPU core: rules, products, and gradients of weights.
 *
 * A table (offsets, rows) says which input row adds to each output row through each kernel offset, -1 for
 * none. Rows are gathered and multiplied without being written down ("implicit GEMM"; Tang et al.,
 * "TorchSparse++", MICRO 2023). Sums have a fixed order, so that the same input gives the same bytes. Numbers
 * of output channels are multiples of 16. `sparse_compiled.py` says more about each function.
 */

#include <stdint.h>
#include <string.h>

/* Vectors as wide as the processor's registers: compilers keep wider ones in memory. So many rows of sums fit
 * into the registers, where a row has 64, 32 or 16 columns. */
#if defined(__AVX512F__)
#define LANES 16
#define ROWS_64 4
#define ROWS_32 8
#define ROWS_16 8
#else
#if defined(__AVX__)
#define LANES 8
#else
#define LANES 4
#endif
#define ROWS_64 1
#define ROWS_32 2
#define ROWS_16 4
#endif
#define BLOCK 64 /* output rows at a time, whose sums stay in the nearest cache */
#define CHUNK 256 /* pairs of rows at a time in a gradient of weights */
typedef float vec __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

/* out[i] += x[i] @ weight for n rows, ROWS at a time, in NV vectors from `column` on. */
#define ADD_PRODUCTS(NAME, ROWS, NV)                                                                       \
    static void NAME(const float *const *x, float *const *out, int n, const float *weight, int64_t c_in,   \
                     int64_t c_out, int64_t column) {                                                      \
        for (int i = 0; i < n; i += ROWS) {                                                                \
            vec sum[ROWS][NV];                                                                             \
            for (int r = 0; r < ROWS; r++)                                                                 \
                for (int v = 0; v < NV; v++) sum[r][v] = *(const vec *)(out[i + r] + column + v * LANES);  \
            for (int64_t c = 0; c < c_in; c++)                                                             \
                for (int v = 0; v < NV; v++) {                                                             \
                    const vec factor = *(const vec *)(weight + c * c_out + column + v * LANES);            \
                    for (int r = 0; r < ROWS; r++) sum[r][v] += factor * x[i + r][c];                      \
                }                                                                                          \
            for (int r = 0; r < ROWS; r++)                                                                 \
                for (int v = 0; v < NV; v++) *(vec *)(out[i + r] + column + v * LANES) = sum[r][v];        \
        }                                                                                                  \
    }
ADD_PRODUCTS(add_products_64, ROWS_64, 64 / LANES)
ADD_PRODUCTS(add_products_32, ROWS_32, 32 / LANES)
ADD_PRODUCTS(add_products_16, ROWS_16, 16 / LANES)

void gathered_products(const float *features, const float *weight, const int32_t *table, float *out,
                       int64_t rows, int64_t offsets, int64_t c_in, int64_t c_out, float *scratch) {
    const float *x[BLOCK + ROWS_16];
    float *sums[BLOCK + ROWS_16];
    const float *zeros = scratch;   /* c_in of them, and c_out sums of these rows, for groups that are not full */
    float *unused = scratch + c_in;
    if (!rows) return;
    memset(scratch, 0, sizeof(float) * (c_in + c_out));
    memset(out, 0, sizeof(float) * rows * c_out);
    for (int64_t first = 0; first < rows; first += BLOCK) {
        const int64_t last = first + BLOCK < rows ? first + BLOCK : rows;
        for (int64_t k = 0; k < offsets; k++) {
            int n = 0;
            for (int64_t row = first; row < last; row++) {
                const int64_t source = table[k * rows + row];
                x[n] = features + (source < 0 ? 0 : source) * c_in; /* of no source: not counted */
                sums[n] = out + row * c_out;
                n += source >= 0;
            }
            for (int i = n; i < n + ROWS_16; i++) x[i] = zeros, sums[i] = unused;
            const float *w = weight + k * c_in * c_out;
            int64_t column = 0;
            for (; column + 64 <= c_out; column += 64) add_products_64(x, sums, n, w, c_in, c_out, column);
            for (; column + 32 <= c_out; column += 32) add_products_32(x, sums, n, w, c_in, c_out, column);
            for (; column < c_out; column += 16) add_products_16(x, sums, n, w, c_in, c_out, column);
        }
    }
}

/* out += x^T @ grad over n pairs of rows, for C of the input channels from `channel` on and NV vectors from
 * `column` on. */
#define ADD_OUTER_PRODUCTS(NAME, C, NV)                                                                    \
    static void NAME(const float *const *x, const float *const *grad, int n, float *out, int64_t c_out,    \
                     int64_t channel, int64_t column) {                                                    \
        vec sum[C][NV];                                                                                    \
        float *place = out + channel * c_out + column;                                                     \
        for (int c = 0; c < C; c++)                                                                        \
            for (int v = 0; v < NV; v++) sum[c][v] = *(const vec *)(place + c * c_out + v * LANES);        \
        for (int i = 0; i < n; i++)                                                                        \
            for (int v = 0; v < NV; v++) {                                                                 \
                const vec factor = *(const vec *)(grad[i] + column + v * LANES);                           \
                for (int c = 0; c < C; c++) sum[c][v] += factor * x[i][channel + c];                       \
            }                                                                                              \
        for (int c = 0; c < C; c++)                                                                        \
            for (int v = 0; v < NV; v++) *(vec *)(place + c * c_out + v * LANES) = sum[c][v];              \
    }
ADD_OUTER_PRODUCTS(add_outer_32, ROWS_16, 32 / LANES)
ADD_OUTER_PRODUCTS(add_outer_16, ROWS_16, 16 / LANES)
ADD_OUTER_PRODUCTS(add_outer_16_of_one, 1, 16 / LANES)

void weight_products(const float *features, const float *grad, const int32_t *table, float *out, int64_t rows,
                     int64_t offsets, int64_t c_in, int64_t c_out) {
    const float *x[CHUNK], *g[CHUNK];
    memset(out, 0, sizeof(float) * offsets * c_in * c_out);
    for (int64_t k = 0; k < offsets; k++) {
        float *w = out + k * c_in * c_out;
        for (int64_t row = 0; row < rows;) {
            int n = 0;
            for (; row < rows && n < CHUNK; row++) {
                const int64_t source = table[k * rows + row];
                x[n] = features + (source < 0 ? 0 : source) * c_in; /* of no source: not counted */
                g[n] = grad + row * c_out;
                n += source >= 0;
            }
            int64_t column = 0, c;
            for (; column + 32 <= c_out; column += 32) {
                for (c = 0; c + ROWS_16 <= c_in; c += ROWS_16) add_outer_32(x, g, n, w, c_out, c, column);
                for (; c < c_in; c++)
                    for (int half = 0; half < 32; half += 16)
                        add_outer_16_of_one(x, g, n, w, c_out, c, column + half);
            }
            for (; column < c_out; column += 16) {
                for (c = 0; c + ROWS_16 <= c_in; c += ROWS_16) add_outer_16(x, g, n, w, c_out, c, column);
                for (; c < c_in; c++) add_outer_16_of_one(x, g, n, w, c_out, c, column);
            }
        }
    }
}

void submanifold_table(const int64_t *keys, int64_t rows, int64_t height, int64_t width, int32_t *table) {
    if (!rows) return;
    memset(table, 0xff, sizeof(int32_t) * 27 * rows);
    for (int64_t row = 0; row < rows; row++) table[13 * rows + row] = (int32_t)row;
    /* The other half of the offsets is the mirror image. Keys ascend, and so do those of the neighbours. */
    for (int k = 14; k < 27; k++) {
        const int64_t step = ((k / 9 - 1) * height + k / 3 % 3 - 1) * width + k % 3 - 1;
        int32_t *to = table + k * rows, *from = table + (26 - k) * rows;
        int64_t other = 0;
        for (int64_t row = 0; row < rows; row++) {
            while (other < rows && keys[other] < keys[row] + step) other++;
            if (other < rows && keys[other] == keys[row] + step)
                to[row] = (int32_t)other, from[other] = (int32_t)row;
        }
    }
}

/* Cells along z, y, x of the inputs and the outputs, kernel, stride and padding. */
typedef struct {
    int64_t in[3], out[3], kernel[3], stride[3], padding[3];
} geometry;

/* The cells of the output that a site reaches, and the kernel offset of each; returns how many. */
static int reached(int64_t key, const geometry *g, int64_t *cells, int *offsets) {
    int64_t at[3], batch = key;
    for (int axis = 2; axis >= 0; axis--) at[axis] = batch % (g->in[axis] + 2) - 1, batch /= g->in[axis] + 2;
    int n = 1;
    cells[0] = batch, offsets[0] = 0;
    for (int axis = 0; axis < 3; axis++) {
        int64_t before[27];
        int offsets_before[27], count = n;
        memcpy(before, cells, sizeof(int64_t) * n);
        memcpy(offsets_before, offsets, sizeof(int) * n);
        n = 0;
        for (int i = 0; i < count; i++)
            for (int64_t k = 0; k < g->kernel[axis]; k++) {
                const int64_t moved = at[axis] + g->padding[axis] - k, cell = moved / g->stride[axis];
                if (moved < 0 || moved % g->stride[axis] || cell >= g->out[axis]) continue;
                cells[n] = before[i] * (g->out[axis] + 2) + cell + 1;
                offsets[n++] = (int)(offsets_before[i] * g->kernel[axis] + k);
            }
    }
    return n;
}

int64_t strided_sites(const int64_t *keys, int64_t rows, const geometry *g, uint64_t *occupied,
                      int32_t *places, int64_t words, int64_t *sites) {
    int64_t cells[27], found = 0;
    int offsets[27];
    for (int64_t row = 0; row < rows; row++)
        for (int n = reached(keys[row], g, cells, offsets); n--;)
            occupied[cells[n] / 64] |= (uint64_t)1 << cells[n] % 64;
    for (int64_t word = 0; word < words; word++) {
        places[word] = (int32_t)found;
        for (uint64_t rest = occupied[word]; rest; rest &= rest - 1)
            sites[found++] = word * 64 + __builtin_ctzll(rest);
    }
    return found;
}

void strided_tables(const int64_t *keys, int64_t rows, const geometry *g, const uint64_t *occupied,
                    const int32_t *places, int64_t outputs, int32_t *table, int32_t *table_of_inputs) {
    const int64_t offsets_of_kernel = g->kernel[0] * g->kernel[1] * g->kernel[2];
    int64_t cells[27];
    int offsets[27];
    if (!rows) return;
    memset(table, 0xff, sizeof(int32_t) * offsets_of_kernel * outputs);
    memset(table_of_inputs, 0xff, sizeof(int32_t) * offsets_of_kernel * rows);
    for (int64_t row = 0; row < rows; row++)
        for (int n = reached(keys[row], g, cells, offsets); n--;) {
            const uint64_t before = occupied[cells[n] / 64] & (((uint64_t)1 << cells[n] % 64) - 1);
            const int32_t place = places[cells[n] / 64] + __builtin_popcountll(before);
            table[offsets[n] * outputs + place] = (int32_t)row;
            table_of_inputs[offsets[n] * rows + row] = place;
        }
}
