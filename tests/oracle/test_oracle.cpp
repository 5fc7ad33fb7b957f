/** @file
 *  Holds the library against the oracle on random problems. Built twice, for float32 and float64. HULLGUARD_SEED repeats a run. */
#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <random>
#include <setjmp.h>
#include <string>
#include <vector>

extern "C" {
#include <cmocka.h>

#include "hullguard/bank.h"
#include "hullguard/decision.h"
#include "hullguard/detector.h"
#include "hullguard/hold.h"
#include "hullguard/hull.h"
#include "hullguard/residual.h"
#include "hullguard/trigger.h"
#include "hullguard/uio.h"
}

namespace {

using oracle::Matrix;
using oracle::Vector;
using std::size_t;
using Reals = std::vector<hg_real>;

constexpr double unit = static_cast<double>(std::numeric_limits<hg_real>::epsilon()); /* two units of rounding of the library's number */
constexpr double unit_double = std::numeric_limits<double>::epsilon();
constexpr int    problems = 1000;

/* ---- Small tools ---- */

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double real(double low, double high) { return low + (high - low) * std::ldexp(static_cast<double>(engine_() >> 11), -53); }
    int    whole(int low, int high) { return static_cast<int>(integer(low, high)); }
    bool   chance(double p) { return real(0.0, 1.0) < p; }
    std::int64_t integer(std::int64_t low, std::int64_t high)
    {
        return low + static_cast<std::int64_t>(engine_() % static_cast<std::uint64_t>(high - low + 1));
    }
    Matrix matrix(Eigen::Index rows, Eigen::Index cols)
    {
        return Matrix::NullaryExpr(rows, cols, [this]() { return real(-1.0, 1.0); });
    }

private:
    std::mt19937_64 engine_;
};

std::uint64_t the_seed = 0;

/* One stream a test, so that a test repeats alone. */
Random stream(std::uint64_t test) { return Random(the_seed * 1000003U + test); }

std::string say(const char *format, ...) __attribute__((format(printf, 1, 2)));
std::string say(const char *format, ...)
{
    char    text[600];
    va_list list;
    va_start(list, format);
    std::vsnprintf(text, sizeof text, format, list);
    va_end(list);
    return text;
}

/* Only here may cmocka jump out: nothing with a destructor is alive above the caller's result. */
void expect_clean(const std::string &failure)
{
    if (!failure.empty()) {
        fail_msg("HULLGUARD_SEED=%llu: %s", static_cast<unsigned long long>(the_seed), failure.c_str());
    }
}

hg_real nearest(double x) { return static_cast<hg_real>(x); }

hg_real round_up(double x)
{
    const hg_real y = nearest(x);
    return (static_cast<double>(y) < x) ? std::nextafter(y, std::numeric_limits<hg_real>::infinity()) : y;
}

Reals row_major(const Matrix &m)
{
    Reals out;
    for (Eigen::Index i = 0; i < m.rows(); ++i) {
        for (Eigen::Index j = 0; j < m.cols(); ++j) {
            out.push_back(nearest(m(i, j)));
        }
    }
    return out;
}

double spectral_radius(const Matrix &m)
{
    return m.rows() == 0 ? 0.0 : m.eigenvalues().cwiseAbs().maxCoeff();
}

Matrix beside(const Matrix &a, const Matrix &b)
{
    Matrix out(a.rows(), a.cols() + b.cols());
    out << a, b;
    return out;
}

/* ---- Random generators ---- */

/* Real, complex, repeated and defective eigenvalues within the radius, seen from a random basis. */
Matrix random_stable(Random &random, Eigen::Index n, double radius)
{
    Matrix       m = Matrix::Zero(n, n);
    Eigen::Index i = 0;
    while (i < n) {
        const double       rho  = random.real(0.0, radius);
        const double       turn = random.real(0.1, 3.0);
        const bool         pair = random.chance(0.4) && n - i >= 2;
        const Eigen::Index most = (n - i) / (pair ? 2 : 1);
        const Eigen::Index size = random.chance(0.5) ? 1 : std::min<Eigen::Index>(most, random.whole(2, 3)); /* of the Jordan block */
        for (Eigen::Index b = 0; b < size; ++b) {
            if (pair) {
                m.block(i, i, 2, 2) << rho * std::cos(turn), rho * std::sin(turn), -rho * std::sin(turn), rho * std::cos(turn);
                if (b > 0) { m.block(i - 2, i, 2, 2) = Matrix::Identity(2, 2); }
            } else {
                m(i, i) = random.chance(0.5) ? rho : (size > 1 ? rho : -rho);
                if (b > 0) { m(i - 1, i) = 1.0; m(i, i) = m(i - 1, i - 1); }
            }
            i += pair ? 2 : 1;
        }
    }
    Matrix basis = random.matrix(n, n).householderQr().householderQ();
    for (Eigen::Index c = 0; c < n; ++c) { basis.col(c) *= std::exp(random.real(-0.5, 0.5)); }
    return basis * m * basis.inverse();
}

/* Stable observer and stable post-filter: one of the two gets the random poles, the other follows while Lo is small enough. */
oracle::Generator random_generator(Random &random)
{
    const int         s = random.whole(1, 8), r = random.whole(1, 3), width = random.whole(1, 6);
    const int         m = random.whole(0, width), p = width - m;
    const Matrix      stable = random_stable(random, s, 0.9);
    const bool        filter = random.chance(0.5);
    oracle::Generator g{stable, random.matrix(s, p), random.matrix(s, m), random.matrix(r, s), random.matrix(r, m), random.matrix(r, p),
                        random.matrix(s, r), random.matrix(r, r)};
    const auto other = [&]() -> Matrix { return filter ? Matrix(stable + g.Lo * g.W) : Matrix(stable - g.Lo * g.W); };
    while (spectral_radius(other()) > 0.95) {
        g.Lo *= 0.5;
    }
    if (filter) { g.G = other(); }
    return g;
}

/* A linear system as the library's tables describe one, with the magnitudes its coefficients were summed from. */
struct System {
    Matrix A, B, C, D;
    Matrix A_abs, B_abs, C_abs, D_abs;
};

System plain(const Matrix &A, const Matrix &B, const Matrix &C, const Matrix &D)
{
    return {A, B, C, D, A.cwiseAbs(), B.cwiseAbs(), C.cwiseAbs(), D.cwiseAbs()};
}

/* residual.h; platoon, section 3, "Fused form" */
System fused(const oracle::Generator &g)
{
    System s = plain(g.G - g.Lo * g.W, beside(g.L + g.Lo * g.V, g.H - g.Lo * g.Qu), -g.Mo * g.W, g.Mo * beside(g.V, -g.Qu));
    const Matrix Lo = g.Lo.cwiseAbs(), Mo = g.Mo.cwiseAbs();
    s.A_abs = g.G.cwiseAbs() + Lo * g.W.cwiseAbs();
    s.B_abs = beside(g.L.cwiseAbs() + Lo * g.V.cwiseAbs(), g.H.cwiseAbs() + Lo * g.Qu.cwiseAbs());
    s.C_abs = Mo * g.W.cwiseAbs();
    s.D_abs = Mo * beside(g.V, g.Qu).cwiseAbs();
    return s;
}

System observer(const oracle::Generator &g) { return plain(g.G, beside(g.L, g.H), -g.W, beside(g.V, -g.Qu)); }
System filter(const oracle::Generator &g)
{
    System s = plain(g.G - g.Lo * g.W, g.Lo, -g.Mo * g.W, g.Mo);
    s.A_abs = g.G.cwiseAbs() + g.Lo.cwiseAbs() * g.W.cwiseAbs();
    s.C_abs = g.Mo.cwiseAbs() * g.W.cwiseAbs();
    return s;
}

/* Observer and filter in series as one system of twice the order, for its rounding bound. */
System series(const oracle::Generator &g)
{
    const System       o = observer(g), f = filter(g);
    const Eigen::Index s = g.G.rows();
    const auto stack = [s](const Matrix &oA, const Matrix &oB, const Matrix &oC, const Matrix &oD, const Matrix &fA, const Matrix &fB,
                           const Matrix &fC, const Matrix &fD) {
        Matrix A = Matrix::Zero(2 * s, 2 * s), B(2 * s, oB.cols());
        A << oA, Matrix::Zero(s, s), fB * oC, fA;
        B << oB, fB * oD;
        return plain(A, B, beside(fD * oC, fC), fD * oD);
    };
    System       all = stack(o.A, o.B, o.C, o.D, f.A, f.B, f.C, f.D);
    const System abs = stack(o.A_abs, o.B_abs, o.C_abs, o.D_abs, f.A_abs, f.B_abs, f.C_abs, f.D_abs);
    all.A_abs = abs.A; all.B_abs = abs.B; all.C_abs = abs.C; all.D_abs = abs.D;
    return all;
}

/* Rounding bound of a run (platoon, section 8). A row of n products, its coefficients rounded too, is wrong by at most (n + 2) units of
 *  sum |a||x| (Higham's gamma); coefficients that are themselves sums of `inner` products add as many. One step's error e then reaches r as
 *  sum over lags of |C A^j| e. Units are doubled (unit is epsilon, not epsilon / 2), which covers second order terms. */
Vector rounding(const System &s, Eigen::Index inner, const Vector &state_max, const Vector &input_max, double epsilon)
{
    const double gamma = static_cast<double>(s.A.cols() + s.B.cols() + inner + 3) * epsilon;
    const Vector step  = gamma * (s.A_abs * state_max + s.B_abs * input_max);
    Vector       total = gamma * (s.C_abs * state_max + s.D_abs * input_max);
    Matrix       response = s.C;
    for (int j = 0; j < 3000; ++j) {
        total += response.cwiseAbs() * step;
        response *= s.A;
    }
    return total;
}

/* Tables of a residual generator in the library's number. */
struct Residual {
    Reals                     A, B, C, D, memory;
    std::vector<std::uint8_t> signal;
    hg_residual_config        config{};
    hg_residual               self{};

    Residual(const System &s, const std::vector<std::uint8_t> &places)
        : A(row_major(s.A)), B(row_major(s.B)), C(row_major(s.C)), D(row_major(s.D)), signal(places)
    {
        const auto n = static_cast<std::uint8_t>(s.A.rows()), r = static_cast<std::uint8_t>(s.C.rows());
        const auto w = static_cast<std::uint8_t>(s.B.cols());
        config = {n, r, w, signal.data(), {n, n, 0, A.data()}, {n, w, 0, B.data()}, {r, n, 0, C.data()}, {r, w, 0, D.data()}};
        memory.resize(HG_RESIDUAL_REALS(n, w));
    }
    Residual(const Residual &) = delete;
    Residual &operator=(const Residual &) = delete;
    bool start() { return hg_residual_start(&self, &config, memory.data()) == HG_OK; }
};

std::vector<std::uint8_t> identity_places(Eigen::Index n)
{
    std::vector<std::uint8_t> places(static_cast<size_t>(n));
    std::iota(places.begin(), places.end(), static_cast<std::uint8_t>(0));
    return places;
}

/* Distinct places of `width` signals in a vector of `of`. */
std::vector<std::uint8_t> random_places(Random &random, Eigen::Index width, Eigen::Index of)
{
    std::vector<std::uint8_t> places = identity_places(of);
    for (size_t i = places.size() - 1; i > 0; --i) {
        std::swap(places[i], places[static_cast<size_t>(random.integer(0, static_cast<std::int64_t>(i)))]);
    }
    places.resize(static_cast<size_t>(width));
    return places;
}

/* ---- a) Residual generators ---- */

struct Worst {
    double of_tolerance = 0.0; /* difference over derived tolerance */
    double relative     = 0.0; /* difference over signal scale */
};

std::string one_residual(Random &random, Worst &worst)
{
    const oracle::Generator g      = random_generator(random);
    const Eigen::Index      m      = g.V.cols(), width = m + g.H.cols(), all = width + random.whole(0, 3), r = g.Mo.rows();
    const auto              places = random_places(random, width, all);
    const double            size   = std::pow(10.0, random.real(-3.0, 3.0));
    const int               samples = 200;

    Residual one(fused(g), places), two(observer(g), places), three(filter(g), identity_places(r));
    if (!one.start() || !two.start() || !three.start()) { return "start refused"; }
    hg_residual_pair pair{two.self, three.self};

    oracle::Cascade     cascade(g);
    std::vector<Vector> expected;
    std::vector<Reals>  of_one, of_pair;
    Vector in_max = Vector::Zero(width), z_max = Vector::Zero(g.G.rows()), both_max = Vector::Zero(2 * g.G.rows());
    Vector both(2 * g.G.rows());
    for (int k = 0; k < samples; ++k) {
        Reals value(static_cast<size_t>(all));
        for (hg_real &v : value) { v = nearest(size * random.real(-1.0, 1.0)); }
        Vector in(width);
        for (Eigen::Index i = 0; i < width; ++i) { in(i) = static_cast<double>(value[places[static_cast<size_t>(i)]]); }
        in_max = in_max.cwiseMax(in.cwiseAbs());
        both << cascade.observer(), cascade.filter();
        both_max = both_max.cwiseMax(both.cwiseAbs());
        z_max    = z_max.cwiseMax((cascade.observer() + cascade.filter()).cwiseAbs()); /* the fused state is their sum */
        expected.push_back(cascade.step(in.head(m), in.tail(width - m)));

        Reals a(static_cast<size_t>(r)), b0(static_cast<size_t>(r)), b(static_cast<size_t>(r));
        if (random.chance(0.02)) { /* a number that is not finite is refused and changes nothing */
            Reals bad = value;
            bad[places[0]] = random.chance(0.5) ? std::numeric_limits<hg_real>::quiet_NaN() : -std::numeric_limits<hg_real>::infinity();
            if (hg_residual_step(&one.self, bad.data(), a.data()) != HG_E_NUMERIC ||
                hg_residual_pair_step(&pair, bad.data(), b0.data(), b.data()) != HG_E_NUMERIC) { return "a bad number was taken"; }
        }
        if (hg_residual_step(&one.self, value.data(), a.data()) != HG_OK) { return "step refused"; }
        if (hg_residual_pair_step(&pair, value.data(), b0.data(), b.data()) != HG_OK) { return "pair refused"; }
        of_one.push_back(a);
        of_pair.push_back(b);
    }
    /* The oracle rounds as well: its own bound, in double, comes on top of the library's. */
    const Vector of_oracle = rounding(series(g), r, both_max, in_max, unit_double);
    const Vector tolerance_one  = rounding(fused(g), r, z_max, in_max, unit) + of_oracle;
    const Vector tolerance_pair = rounding(series(g), r, both_max, in_max, unit) + of_oracle;
    double scale = 0.0;
    for (const Vector &e : expected) { scale = std::max(scale, e.cwiseAbs().maxCoeff()); }
    for (size_t k = 0; k < expected.size(); ++k) {
        for (Eigen::Index i = 0; i < r; ++i) {
            const size_t c    = static_cast<size_t>(i);
            const double d1   = std::abs(static_cast<double>(of_one[k][c]) - expected[k](i));
            const double d2   = std::abs(static_cast<double>(of_pair[k][c]) - static_cast<double>(of_one[k][c]));
            const double most = tolerance_one(i) + tolerance_pair(i);
            worst.of_tolerance = std::max({worst.of_tolerance, d1 / tolerance_one(i), d2 / most});
            worst.relative     = std::max({worst.relative, d1 / scale, d2 / scale});
            if (!(d1 <= tolerance_one(i))) {
                return say("k %zu: r%zu is %.17g, oracle %.17g, off by %g > %g", k, c, static_cast<double>(of_one[k][c]), expected[k](i), d1,
                           tolerance_one(i));
            }
            if (!(d2 <= most)) { return say("k %zu: pair and fused differ by %g > %g", k, d2, most); }
        }
    }
    return {};
}

/* The derived tolerance is rigorous but may be wide for a badly conditioned generator; the flat one, relative to the largest residual, is
 *  what the number type should give: some 10^3 units for orders up to 8 and poles up to 0.95. */
void test_residual(void **)
{
    Random      random = stream(1);
    Worst       worst;
    std::string failure;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_residual(random, worst);
        if (!failure.empty()) { failure = say("generator %d: ", i) + failure; }
    }
    const double flat = (sizeof(hg_real) == 8) ? 1e-11 : 1e-4;
    std::printf("residual: worst difference %.3g of its tolerance, %.3g of the largest residual\n", worst.of_tolerance, worst.relative);
    if (failure.empty() && !(worst.relative <= flat)) { failure = say("relative difference %g > %g", worst.relative, flat); }
    expect_clean(failure);
}

/* ---- b) The hull ---- */

/* |h_ig(taps_g + j)| <= weight (residuals x signals) x decay_i^j for all j >= 0 */
struct Tail {
    Vector decay;
    Matrix weight;
    bool   modal = false;
};

using Taps = std::vector<int>; /* of each signal */

/* platoon, section 6: h(lag) = C A^(lag-1) B, A = S Lam S^-1 */
Tail modal_tail(const System &s, const Taps &taps)
{
    const Eigen::EigenSolver<Matrix> eigen(s.A);
    const Eigen::MatrixXcd           S   = eigen.eigenvectors();
    const Vector                     lam = eigen.eigenvalues().cwiseAbs();
    const Matrix                     out = (s.C * S).cwiseAbs(), in = (S.inverse() * s.B).cwiseAbs();
    Tail t{Vector::Constant(s.C.rows(), lam.maxCoeff()), Matrix(s.C.rows(), s.B.cols()), true};
    for (Eigen::Index g = 0; g < s.B.cols(); ++g) {
        const Vector power = lam.array().pow(taps[static_cast<size_t>(g)] - 1);
        t.weight.col(g)    = out * power.cwiseProduct(in.col(g));
    }
    return t;
}

/* For a defective A: |A^q| = beta < 1, so |A^n| <= (max of |A^b|, b < q) beta^floor(n/q), and floor(n/q) >= (n - q + 1) / q. */
Tail power_tail(const System &s, const Taps &taps)
{
    const auto norm = [](const Matrix &m) { return m.cwiseAbs().rowwise().sum().maxCoeff(); };
    Matrix power = s.A;
    double most = 1.0;
    int    q = 1;
    while (norm(power) >= 0.9) {
        most = std::max(most, norm(power));
        power *= s.A;
        ++q;
    }
    const double beta = norm(power), decay = (beta == 0.0) ? 0.5 : std::pow(beta, 1.0 / q);
    Tail t{Vector::Constant(s.C.rows(), decay), Matrix(s.C.rows(), s.B.cols()), false};
    for (Eigen::Index g = 0; g < s.B.cols(); ++g) {
        Matrix first = s.C;
        for (int j = 1; j < taps[static_cast<size_t>(g)]; ++j) { first *= s.A; }
        t.weight.col(g) = first.cwiseAbs().rowwise().sum() * most * std::pow(decay, 1 - q) * s.B.col(g).cwiseAbs().maxCoeff();
    }
    return t;
}

/* Is A = S Lam S^-1 to be trusted? Not when S is nearly singular, and for a double eigenvalue whose imaginary parts vanish in rounding Eigen
 *  hands out columns that are no eigenvectors at all. */
bool diagonalisable(const Matrix &A)
{
    const Eigen::EigenSolver<Matrix> eigen(A);
    const Eigen::MatrixXcd           S = eigen.eigenvectors();
    const Vector singular = Eigen::JacobiSVD<Eigen::MatrixXcd>(S).singularValues();
    const double residual = (A * S - S * eigen.eigenvalues().asDiagonal()).cwiseAbs().maxCoeff();
    return singular.minCoeff() > 1e-5 * singular.maxCoeff() && residual <= 1e-12 * (1.0 + A.cwiseAbs().maxCoeff());
}

/* Residuals may forget slower than they must, each at a pace of its own. */
Tail tail_of(Random &random, const System &s, const Taps &taps)
{
    Tail t = diagonalisable(s.A) ? modal_tail(s, taps) : power_tail(s, taps);
    for (double &decay : t.decay) { decay += random.chance(0.5) ? 0.0 : (1.0 - decay) * random.real(0.0, 0.5); }
    return t;
}

/* What the initial state and the disturbances add to a threshold: sample by sample, and what a tail takes over then. */
struct Bias {
    Matrix rest, moving; /* samples x residuals */
    Vector rest_left, moving_left, later;
};

/* Tables of a hull. Every table is widened by what the sums of the library can lose (platoon, section 8), then rounded up. */
struct HullTables {
    Reals                     weight, rest, moving, rest_left, moving_left, bias, decay, tail;
    std::vector<std::uint8_t> signal, taps;
    hg_hull_config            config{};

    HullTables(const System &s, const std::vector<std::uint8_t> &places, const Taps &lags, const Bias &start, const Tail &behind, int ready_rest,
               int ready_moving)
        : signal(places), taps(lags.begin(), lags.end())
    {
        const double widen = 1.0 + unit * (10.0 + 2.0 * static_cast<double>(s.B.cols()) + std::accumulate(lags.begin(), lags.end(), 0.0));
        lay_out(s, widen);
        append(rest, start.rest * widen);
        append(moving, start.moving * widen);
        append(rest_left, start.rest_left * widen);
        append(moving_left, start.moving_left * widen);
        append(bias, start.later * widen);
        append(decay, behind.decay * (1.0 + 8.0 * unit));
        append(tail, behind.weight * widen);
        config.residuals    = static_cast<std::uint8_t>(s.C.rows());
        config.width        = static_cast<std::uint8_t>(s.B.cols());
        config.signal       = signal.data();
        config.taps         = taps.data();
        config.weight       = weight.data();
        config.settle       = static_cast<std::uint16_t>(start.rest.rows());
        config.rest         = rest.data();
        config.rest_left    = rest_left.data();
        config.moving       = moving.data();
        config.moving_left  = moving_left.data();
        config.bias         = bias.data();
        config.ready_rest   = static_cast<std::uint16_t>(ready_rest);
        config.ready_moving = static_cast<std::uint16_t>(ready_moving);
        config.decay        = decay.data();
        config.tail         = tail.data();
    }
    HullTables(const HullTables &) = delete;
    HullTables &operator=(const HullTables &) = delete;

    /* hull.h: of each two residuals signal after signal, lag after lag. */
    void lay_out(const System &s, double widen)
    {
        std::vector<Matrix> response{s.D.cwiseAbs()};
        Matrix              lag = s.B;
        for (int j = 1; j < *std::max_element(taps.begin(), taps.end()); ++j) {
            response.push_back((s.C * lag).cwiseAbs());
            lag = s.A * lag;
        }
        for (Eigen::Index i = 0; i < s.C.rows(); i += 2) {
            const Eigen::Index both = std::min<Eigen::Index>(2, s.C.rows() - i);
            for (Eigen::Index g = 0; g < s.B.cols(); ++g) {
                for (size_t j = 0; j < taps[static_cast<size_t>(g)]; ++j) { append(weight, response[j].block(i, g, both, 1) * widen); }
            }
        }
    }

    static void append(Reals &table, const Matrix &rows)
    {
        for (Eigen::Index i = 0; i < rows.rows(); ++i) {
            for (Eigen::Index j = 0; j < rows.cols(); ++j) { table.push_back(round_up(rows(i, j))); }
        }
    }
};

struct HullCount {
    int modal = 0, power = 0, tight = 0, handed = 0; /* handed: thresholds that still hold what is left of a start */
    double widest = 0.0; /* J over exact J where the tail is negligible */
};

/* Radii of one sample: bursts, long silences (a radius that grows), nothing. */
void random_radii(Random &random, Reals &radius, std::vector<int> &mode)
{
    for (size_t i = 0; i < radius.size(); ++i) {
        if (random.chance(0.05)) { mode[i] = random.whole(0, 3); }
        const double old = static_cast<double>(radius[i]);
        radius[i] = nearest(mode[i] == 0 ? 0.0 : mode[i] == 1 ? random.real(0.0, 1.0) : mode[i] == 2 ? std::min(50.0, old * 1.1 + 0.01) : old);
    }
}

Bias random_bias(Random &random, Eigen::Index settle, Eigen::Index residuals)
{
    const double scale = random.chance(0.7) ? 1.0 : 0.0;
    Bias b{scale * random.matrix(settle, residuals).cwiseAbs(), Matrix(), scale * random.matrix(residuals, 1).cwiseAbs(), Vector(),
           scale * random.matrix(residuals, 1).cwiseAbs()};
    b.moving      = b.rest + scale * random.matrix(settle, residuals).cwiseAbs();
    b.moving_left = b.rest_left + scale * random.matrix(residuals, 1).cwiseAbs();
    return b;
}

/* The header's formula over the radii as they are known now, its impulse responses by simulation (hull) and its theta by its own equation. */
struct Formula {
    oracle::Hull               &hull;
    const Taps                 &taps;
    const Tail                 &tail;
    const Bias                 &start;
    Eigen::Index                outputs;
    Vector                      theta;

    Vector step(const std::vector<Vector> &radius, bool rest)
    {
        const int k = static_cast<int>(radius.size()) - 1, settle = static_cast<int>(start.rest.rows());
        if (k == 0) { theta = Vector::Zero(tail.decay.size()); }
        theta = theta.cwiseProduct(tail.decay);
        Vector J = (k < settle) ? Vector((rest ? start.rest : start.moving).row(k).transpose()) : start.later;
        for (Eigen::Index g = 0; g < tail.weight.cols(); ++g) {
            const int lags = taps[static_cast<size_t>(g)];
            if (k >= lags) { theta += tail.weight.col(g) * radius[static_cast<size_t>(k - lags)](g); }
            for (int j = 0; j < lags && j <= k; ++j) {
                const auto lag = static_cast<size_t>(j);
                J += ((g < outputs) ? hull.of_y(lag).col(g) : hull.of_u(lag).col(g - outputs)) * radius[static_cast<size_t>(k - j)](g);
            }
        }
        if (k == settle) { theta += rest ? start.rest_left : start.moving_left; }
        return J + theta;
    }
};

std::string one_hull(Random &random, HullCount &count)
{
    const oracle::Generator g = random_generator(random);
    const System            s = fused(g);
    const Eigen::Index      m = g.V.cols(), width = s.B.cols(), all = width + random.whole(0, 3), r = s.C.rows();
    const auto              places = random_places(random, width, all);
    const int               most   = random.chance(0.5) ? random.whole(1, 30) : random.whole(30, 120);
    Taps                    taps(static_cast<size_t>(width));
    for (int &t : taps) { t = random.whole(1, most); }
    const int               length = *std::max_element(taps.begin(), taps.end()) + 1 + random.whole(0, 5), settle = random.whole(1, 40);
    const int               ready_rest = random.whole(0, 50), ready_moving = random.whole(0, 50);
    const Bias              start = random_bias(random, settle, r);
    const Tail              tail = tail_of(random, s, taps);
    const HullTables        tables(s, places, taps, start, tail, ready_rest, ready_moving);
    (tail.modal ? count.modal : count.power)++;

    Reals    memory(static_cast<size_t>(all * length)), theta(HG_HULL_REALS(r));
    hg_ring  ring{};
    hg_hull  hull{};
    hg_start how = random.chance(0.5) ? HG_START_REST : HG_START_MOVING;
    if (hg_ring_start(&ring, static_cast<std::uint8_t>(all), static_cast<std::uint8_t>(length), memory.data()) != HG_OK ||
        hg_hull_start(&hull, &tables.config, &ring, how, theta.data()) != HG_OK) { return "start refused"; }

    const oracle::Plant no_plant;
    oracle::Hull        exact(g, no_plant, Vector());
    std::vector<Reals>  radii; /* [sample][place] */
    std::vector<int>    mode(static_cast<size_t>(all), 1);
    Reals               radius(static_cast<size_t>(all));
    const double        peak = (s.D_abs.sum() + s.C_abs.sum() * s.B_abs.sum());
    double              widest = 5.0; /* a rewritten radius is at most 5 */
    Formula             formula{exact, taps, tail, start, m, Vector()};
    for (int step = 0; step < 150; ++step) {
        if (random.chance(0.005)) { /* a restart forgets everything */
            how = random.chance(0.5) ? HG_START_REST : HG_START_MOVING;
            hg_ring_reset(&ring);
            hg_hull_reset(&hull, how);
            radii.clear();
        }
        const int k = static_cast<int>(radii.size());
        random_radii(random, radius, mode);
        if (random.chance(0.02)) {
            Reals bad = radius;
            bad[0] = random.chance(0.5) ? std::numeric_limits<hg_real>::quiet_NaN() : std::numeric_limits<hg_real>::infinity();
            if (hg_ring_push(&ring, bad.data()) != HG_E_NUMERIC) { return "a bad radius was taken"; }
        }
        if (hg_ring_push(&ring, radius.data()) != HG_OK) { return "push refused"; }
        radii.push_back(radius);
        if (random.chance(0.05)) { /* the past turns out to be worse than thought */
            const int first = random.whole(0, static_cast<int>(all) - 1), many = random.whole(1, static_cast<int>(all) - first);
            int       reach = random.whole(1, 20); /* as far as the taps of all that read these places */
            for (size_t i = 0; i < taps.size(); ++i) { reach = (places[i] >= first && places[i] < first + many) ? std::min(reach, taps[i]) : reach; }
            reach = std::min(reach, length - 1);
            for (int lag = 1; lag <= reach; ++lag) {
                Reals wide(static_cast<size_t>(many));
                for (hg_real &w : wide) { w = nearest(random.real(0.0, 5.0)); }
                hg_ring_rewrite(&ring, static_cast<std::uint8_t>(lag), static_cast<std::uint8_t>(first), static_cast<std::uint8_t>(many), wide.data());
                if (lag <= k) { std::copy(wide.begin(), wide.end(), radii[static_cast<size_t>(k - lag)].begin() + first); }
            }
            if (reach > k) { /* before the first sample all radii are 0: put that back */
                const Reals none(static_cast<size_t>(many));
                for (int lag = k + 1; lag <= reach; ++lag) {
                    hg_ring_rewrite(&ring, static_cast<std::uint8_t>(lag), static_cast<std::uint8_t>(first), static_cast<std::uint8_t>(many), none.data());
                }
            }
            const Reals far(static_cast<size_t>(many), nearest(1e6)); /* beyond the ring: ignored */
            hg_ring_rewrite(&ring, static_cast<std::uint8_t>(std::min(255, length + random.whole(0, 9))), static_cast<std::uint8_t>(first),
                             static_cast<std::uint8_t>(many), far.data());
        }
        Reals J(static_cast<size_t>(r));
        hg_hull_step(&hull, &ring, J.data());

        std::vector<Vector> y, u, of_all;
        for (const Reals &row : radii) {
            Vector in(width);
            for (Eigen::Index i = 0; i < width; ++i) { in(i) = static_cast<double>(row[places[static_cast<size_t>(i)]]); }
            y.push_back(in.head(m));
            u.push_back(in.tail(width - m));
            of_all.push_back(in);
        }
        const bool    rest  = how == HG_START_REST;
        const Vector  hull_alone = exact.threshold(y, u), whole = formula.step(of_all, rest);
        const Vector  bias  = (k < settle) ? Vector((rest ? start.rest : start.moving).row(k).transpose()) : start.later;
        const Vector  left  = rest ? start.rest_left : start.moving_left;
        const double  all_taps = std::accumulate(taps.begin(), taps.end(), 0.0);
        const double  slack = 4.0 * unit * (all_taps + 2.0 * static_cast<double>(width) + 12.0 + 3.0 * (k + 1)); /* the decay is widened once a sample */
        for (const hg_real x : radius) { widest = std::max(widest, static_cast<double>(x)); }
        /* rounding of the oracle's and the test's own doubles: powers of a defective matrix, responses that cancel to nothing */
        const double noise = 1e-13 * peak * widest + 1e-12 * whole.maxCoeff();
        for (Eigen::Index i = 0; i < r; ++i) {
            const double j = static_cast<double>(J[static_cast<size_t>(i)]);
            const double handed = (k < settle) ? 0.0 : left(i) * std::pow(tail.decay(i), k - settle), low = hull_alone(i) + bias(i) + handed;
            if (!(j >= low - noise)) { return say("k %d: J%ld %.17g below the exact hull %.17g", k, static_cast<long>(i), j, low); }
            if (!(j >= whole(i) - noise)) { return say("k %d: J%ld %.17g below the formula's %.17g", k, static_cast<long>(i), j, whole(i)); }
            const double high = whole(i) * (1.0 + slack) + noise;
            if (!(j <= high)) { return say("k %d: J%ld %.17g above the formula's %.17g, exact %.17g", k, static_cast<long>(i), j, high, low); }
            count.handed += handed > 1e-3 * low;
            if (low > 1e4 * noise && formula.theta(i) < 1e-6 * low) {
                ++count.tight;
                count.widest = std::max(count.widest, j / low);
            }
        }
        const int ready = (how == HG_START_REST) ? ready_rest : ready_moving;
        if (hg_hull_ready(&hull) != (k + 1 >= ready)) { return say("k %d, ready at %d: hg_hull_ready() says %d", k, ready, hg_hull_ready(&hull)); }
    }
    return {};
}

void test_hull(void **)
{
    Random      random = stream(2);
    HullCount   count;
    std::string failure;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_hull(random, count);
        if (!failure.empty()) { failure = say("generator %d: ", i) + failure; }
    }
    const double small = (sizeof(hg_real) == 8) ? 1e-5 : 2e-3; /* rounding of up to 720 taps, and the tail allowed above */
    std::printf("hull: %d modal tails, %d power tails, %d thresholds with a negligible tail, widest %.9g x exact, %d with the rest of a start\n",
                count.modal, count.power, count.tight, count.widest, count.handed);
    if (failure.empty() && (count.modal < problems / 10 || count.power < problems / 20 || count.tight < problems || count.handed < problems)) { failure = "too few cases of a kind"; }
    if (failure.empty() && !(count.widest <= 1.0 + small)) { failure = say("%g x exact although the tail is negligible", count.widest); }
    expect_clean(failure);
}

/* ---- Plant, observer, post-filter and threshold together ---- */

/* A full-order observer in random coordinates T: T A - G T = L C, H = T B - L D, V C = W T with W = C T^-1, V = I, Qu = D
 *  (platoon, section 2), and any post-filter that is stable. */
struct Loop {
    oracle::Plant     plant;
    oracle::Generator generator;
    Matrix            T;
    Vector            initial;
};

void draw_observer(Random &random, Loop &l)
{
    const Eigen::Index n = l.plant.A.rows(), m = l.plant.C.rows();
    l.T = random.matrix(n, n) + 2.0 * Matrix::Identity(n, n);
    while (std::abs(l.T.determinant()) < 0.1) { l.T += Matrix::Identity(n, n); }
    Matrix gain = random.matrix(n, m);
    while (spectral_radius(l.plant.A - gain * l.plant.C) > 0.95) { gain *= 0.5; }
    oracle::Generator &g = l.generator;
    g.L  = l.T * gain;
    g.G  = l.T * (l.plant.A - gain * l.plant.C) * l.T.inverse();
    g.H  = l.T * l.plant.B - g.L * l.plant.D;
    g.W  = l.plant.C * l.T.inverse();
    g.V  = Matrix::Identity(m, m);
    g.Qu = l.plant.D;
    g.Lo = random.matrix(n, m);
    g.Mo = random.matrix(m, m);
    while (spectral_radius(g.G - g.Lo * g.W) > 0.95) { g.Lo *= 0.5; }
}

Loop random_loop(Random &random)
{
    const int n = random.whole(1, 6), m = random.whole(1, 3), p = random.whole(1, 2);
    Loop l;
    l.plant = {random_stable(random, n, 0.9), random.matrix(n, p), random.matrix(m, n), random.matrix(m, p),
               beside(0.1 * random.matrix(n, n), Matrix::Zero(n, m)), beside(Matrix::Zero(m, n), 0.1 * random.matrix(m, m))};
    l.initial = random.matrix(n, 1).cwiseAbs();
    draw_observer(random, l);
    return l;
}

/* a(k) by the other route, that of the error e = T x - z (platoon, section 5): the oracle must find the same by simulation. */
Matrix bias_by_error(const Loop &l, int rows)
{
    const oracle::Generator &g  = l.generator;
    const Matrix             F  = g.G - g.Lo * g.W;
    const Matrix             Bd = l.T * l.plant.Ed - (g.L + g.Lo * g.V) * l.plant.Fd;
    Matrix bias(rows, g.Mo.rows());
    Matrix reach = g.Mo * g.W; /* Mo W F^k */
    Vector of_d  = (g.Mo * g.V * l.plant.Fd).cwiseAbs().rowwise().sum();
    for (int k = 0; k < rows; ++k) {
        bias.row(k) = ((reach * l.T).cwiseAbs() * l.initial + of_d).transpose();
        of_d += (reach * Bd).cwiseAbs().rowwise().sum();
        reach *= F;
    }
    return bias;
}

/* The signs that drive residual i at sample k to its threshold: the hull is attained, so it is not only an outer bound. */
std::string one_loop(Random &random)
{
    const Loop               l = random_loop(random);
    const oracle::Generator &g = l.generator;
    const Eigen::Index       m = g.V.cols(), p = g.H.cols(), q = l.plant.Ed.cols(), n = l.plant.A.rows();
    const int                last = random.whole(0, 40);
    const Eigen::Index       row  = random.whole(0, static_cast<int>(g.Mo.rows()) - 1);
    const Matrix             F = g.G - g.Lo * g.W, Bd = l.T * l.plant.Ed - (g.L + g.Lo * g.V) * l.plant.Fd;
    const auto sign = [](double x) { return x < 0.0 ? -1.0 : 1.0; };

    std::vector<Matrix> reach{g.Mo * g.W}; /* Mo W F^j */
    for (int j = 0; j <= last; ++j) { reach.push_back(reach.back() * F); }
    const auto response = [&](int lag, const Matrix &direct, const Matrix &input) -> Matrix {
        return lag == 0 ? direct : Matrix(reach[static_cast<size_t>(lag - 1)] * input);
    };

    oracle::Hull        hull(g, l.plant, l.initial);
    oracle::Cascade     cascade(g);
    const Matrix        bias = bias_by_error(l, last + 1);
    std::vector<Vector> y_radius, u_radius;
    Vector x(n), r, J, u_true;
    for (Eigen::Index i = 0; i < n; ++i) { x(i) = l.initial(i) * sign((reach[static_cast<size_t>(last)] * l.T)(row, i)); }
    for (int k = 0; k <= last; ++k) {
        const Matrix of_y = response(last - k, g.Mo * g.V, -(g.L + g.Lo * g.V)), of_u = response(last - k, -g.Mo * g.Qu, -(g.H - g.Lo * g.Qu));
        const Matrix of_d = response(last - k, g.Mo * g.V * l.plant.Fd, Bd);
        y_radius.push_back(random.matrix(m, 1).cwiseAbs());
        u_radius.push_back(random.matrix(p, 1).cwiseAbs());
        Vector ey = y_radius.back(), eu = u_radius.back(), d = Vector::Ones(q);
        for (Eigen::Index i = 0; i < m; ++i) { ey(i) *= sign(of_y(row, i)); }
        for (Eigen::Index i = 0; i < p; ++i) { eu(i) *= sign(of_u(row, i)); }
        for (Eigen::Index i = 0; i < q; ++i) { d(i) *= sign(of_d(row, i)); }
        u_true = random.matrix(p, 1);
        r = cascade.step(l.plant.C * x + l.plant.D * u_true + l.plant.Fd * d + ey, u_true + eu);
        J = hull.threshold(y_radius, u_radius);
        x = l.plant.A * x + l.plant.B * u_true + l.plant.Ed * d;
        if (!((r.cwiseAbs() - J).maxCoeff() <= 1e-9 * J.maxCoeff())) { return say("k %d: a fault-free residual above its threshold", k); }
        const std::vector<Vector> none_y(static_cast<size_t>(k + 1), Vector::Zero(m)), none_u(static_cast<size_t>(k + 1), Vector::Zero(p));
        const double              off = (hull.threshold(none_y, none_u).transpose() - bias.row(k)).cwiseAbs().maxCoeff();
        if (!(off <= 1e-9 * (1.0 + bias.row(k).maxCoeff()))) { return say("k %d: bias by simulation and by error differ by %g", k, off); }
    }
    if (!(std::abs(std::abs(r(row)) - J(row)) <= 1e-9 * J(row))) { return say("worst case %.12g, threshold %.12g", r(row), J(row)); }
    return {};
}

void test_oracle_itself(void **)
{
    Random      random = stream(3);
    std::string failure;
    for (int i = 0; i < problems / 2 && failure.empty(); ++i) {
        failure = one_loop(random);
        if (!failure.empty()) { failure = say("loop %d: ", i) + failure; }
    }
    expect_clean(failure);
}

/* ---- c) Trigger and hold ---- */

/* A group in both shapes: the oracle's, and the library's tables. */
struct Group {
    oracle::Receiver           model; /* its numbers are those of the tables, exactly */
    std::vector<std::uint8_t>  silence;
    std::vector<std::uint16_t> delta;
    std::vector<std::int32_t>  sigma, activity, zero;
    std::vector<hg_code_scale> scale;
    Reals                      half, slew, span, middle;
    std::vector<double>        step; /* largest change of the walk in a sample */
    hg_trigger_config          trigger{};
    hg_hold_config             hold{};

    Group(Random &random, bool extreme);
    Group(Random &random, const oracle::Table &course); /* [sample][channel]: what the signals will do, so that the slew holds */
    Group(const Group &) = delete;
    Group &operator=(const Group &) = delete;
    size_t width() const { return zero.size(); }

private:
    void draw_trigger(Random &random, int width, bool extreme);
    void draw_signals(Random &random, bool extreme);
    void add_scale(double resolution, double offset, std::int64_t low, std::int64_t high);
    void measure_signals(Random &random, const oracle::Table &course);
    void draw_activity(Random &random, bool extreme);
    void connect();
};

void Group::draw_trigger(Random &random, int width, bool extreme)
{
    oracle::Trigger &t = model.trigger;
    const int levels = random.whole(1, 8);
    t.interval_max = random.chance(0.1) ? 1 : random.whole(2, 30);
    int least = 255;
    for (int l = 0; l < levels; ++l) {
        t.silence.push_back(random.chance(0.3) ? 0 : random.whole(0, t.interval_max - 1));
        least = std::min(least, t.silence.back());
    }
    /* a counter of 16 hides 16 frames: the design refuses unless 16 (h_min + 1) > interval_max + margin (platoon, section 4) */
    t.interval_max = std::min(t.interval_max, 16 * (least + 1) - 1);
    for (int &h : t.silence) { h = std::min(h, t.interval_max - 1); }
    least = *std::min_element(t.silence.begin(), t.silence.end());
    t.interval_max = std::min(t.interval_max, 16 * (least + 1) - 1);
    model.margin   = random.whole(0, std::min(6, 16 * (least + 1) - 1 - t.interval_max));
    for (int l = 0; l < levels; ++l) {
        std::vector<double> d, s;
        for (int g = 0; g < width; ++g) {
            d.push_back(random.chance(0.3) ? 0 : random.chance(0.7) ? random.whole(0, 6000) : random.whole(0, 65535));
            s.push_back(random.chance(0.2) ? 0 : (extreme && random.chance(0.5)) ? static_cast<double>(random.integer(0, INT32_MAX)) : random.whole(0, 200));
        }
        t.delta.push_back(d);
        t.sigma.push_back(s);
    }
}

void Group::draw_activity(Random &random, bool extreme)
{
    oracle::Trigger    &t = model.trigger;
    std::vector<double> row(t.zero.size(), 0.0);
    for (int l = 0; l < t.levels(); ++l) {
        t.activity.push_back(row);
        for (double &a : row) { a = std::min(a + (extreme ? static_cast<double>(random.integer(1, INT32_MAX / 10)) : random.whole(1, 150)), 2147483647.0); }
    }
}

/* Scale, half, span and middle of one more channel. */
void Group::add_scale(double resolution, double offset, std::int64_t low, std::int64_t high)
{
    const oracle::Scale s{resolution, offset, static_cast<double>(low), static_cast<double>(high)};
    model.scale.push_back(s);
    scale.push_back({nearest(resolution), nearest(offset), nearest(1.0 / resolution), 0, static_cast<std::int32_t>(low), static_cast<std::int32_t>(high)});
    const double far  = std::max(std::abs(oracle::decode(s, s.minimum)), std::abs(oracle::decode(s, s.maximum))) + std::abs(offset);
    const double wide = resolution * (s.maximum - s.minimum);
    /* code.h: float32 moves the nearest code by 2^-22 |code|; a few units more for encoding and decoding */
    half.push_back(round_up(0.5 * resolution + far * (std::ldexp(1.0, -22) * (sizeof(hg_real) == 4) + 16.0 * unit)));
    span.push_back(round_up(wide + 2.0 * static_cast<double>(half.back())));
    middle.push_back(nearest(0.5 * (oracle::decode(s, s.minimum) + oracle::decode(s, s.maximum))));
    model.half.push_back(static_cast<double>(half.back()));
    model.span.push_back(static_cast<double>(span.back()));
    model.middle.push_back(static_cast<double>(middle.back()));
}

void Group::draw_signals(Random &random, bool extreme)
{
    const size_t rows = static_cast<size_t>(model.trigger.interval_max + model.margin);
    const size_t width = model.trigger.delta[0].size();
    model.slew.assign(rows, std::vector<double>(width));
    for (size_t g = 0; g < width; ++g) {
        const double resolution = static_cast<double>(nearest(std::pow(10.0, random.real(-4.0, 1.0))));
        const double offset     = static_cast<double>(nearest(resolution * random.real(-5000.0, 5000.0)));
        add_scale(resolution, offset, extreme ? random.integer(-INT32_MAX, 0) : random.integer(-32768, 0),
                  extreme ? random.integer(1, INT32_MAX) : random.integer(10, 32767));
        const double wide = resolution * (model.scale[g].maximum - model.scale[g].minimum);
        step.push_back(random.chance(0.5) ? resolution * random.real(0.0, 60.0) : wide * random.real(0.0, 0.2));
        for (size_t j = 0; j < rows; ++j) {
            model.slew[j][g] = std::min(model.span[g], static_cast<double>(round_up(step.back() * static_cast<double>(j + 1) + model.half[g])));
        }
        model.trigger.zero.push_back(random.chance(0.5) ? 0.0 : extreme ? static_cast<double>(random.integer(-INT32_MAX, INT32_MAX)) : random.whole(-9000, 9000));
    }
}

/* Range and slew as the course shows them. */
void Group::measure_signals(Random &random, const oracle::Table &course)
{
    const size_t rows = static_cast<size_t>(model.trigger.interval_max + model.margin);
    const size_t width = course[0].size();
    model.slew.assign(rows, std::vector<double>(width));
    for (size_t g = 0; g < width; ++g) {
        double far = 1e-3;
        for (const auto &row : course) { far = std::max(far, std::abs(row[g])); }
        const auto codes = random.integer(1000, 30000);
        add_scale(static_cast<double>(nearest(1.01 * far / static_cast<double>(codes))), 0.0, -codes, codes);
        for (size_t j = 0; j < rows; ++j) {
            double most = 0.0;
            for (size_t k = j + 1; k < course.size(); ++k) { most = std::max(most, std::abs(course[k][g] - course[k - j - 1][g])); }
            model.slew[j][g] = std::min(model.span[g], static_cast<double>(round_up(most + model.half[g])));
        }
        model.trigger.zero.push_back(0.0);
    }
}

void Group::connect()
{
    const oracle::Trigger &t = model.trigger;
    for (int h : t.silence) { silence.push_back(static_cast<std::uint8_t>(h)); }
    for (size_t l = 0; l < t.silence.size(); ++l) {
        for (size_t g = 0; g < t.zero.size(); ++g) {
            delta.push_back(static_cast<std::uint16_t>(t.delta[l][g]));
            sigma.push_back(static_cast<std::int32_t>(t.sigma[l][g]));
            activity.push_back(static_cast<std::int32_t>(t.activity[l][g]));
        }
    }
    for (double z : t.zero) { zero.push_back(static_cast<std::int32_t>(z)); }
    for (const auto &row : model.slew) {
        for (double s : row) { slew.push_back(nearest(s)); }
    }
    trigger = {static_cast<std::uint8_t>(zero.size()), static_cast<std::uint8_t>(silence.size()), static_cast<std::uint8_t>(t.interval_max),
               silence.data(), delta.data(), sigma.data(), activity.data(), zero.data()};
    hold = {&trigger, static_cast<std::uint8_t>(model.margin), scale.data(), half.data(), slew.data(), span.data(), middle.data()};
}

Group::Group(Random &random, bool extreme)
{
    draw_trigger(random, random.chance(0.03) ? 0 : random.whole(1, 6), extreme);
    draw_signals(random, extreme);
    draw_activity(random, extreme);
    connect();
}

Group::Group(Random &random, const oracle::Table &course)
{
    draw_trigger(random, static_cast<int>(course[0].size()), false);
    measure_signals(random, course);
    draw_activity(random, false);
    connect();
}

std::int32_t to_library(const oracle::Code &code) { return code ? static_cast<std::int32_t>(*code) : HG_CODE_INVALID; }
oracle::Code from_library(std::int32_t code) { return code == HG_CODE_INVALID ? oracle::Code() : oracle::Code(static_cast<double>(code)); }

/* Codes that wander, jump, and vanish; not bound to any slew. */
std::string one_trigger(Random &random, long &frames)
{
    const bool  extreme = random.chance(0.3);
    const Group group(random, extreme);
    const size_t w = group.width();
    if (!hg_trigger_valid(&group.trigger)) { return "valid tables refused"; }
    hg_trigger                self{};
    std::vector<std::int32_t> memory(w + 1), code(w + 1, 0);
    if (hg_trigger_start(&self, &group.trigger, memory.data()) != HG_OK) { return "start refused"; }
    oracle::Sender sender(group.model.trigger);
    const double   vanish = random.chance(0.5) ? 0.0 : 0.05;
    oracle::Codes  now(w);
    std::vector<double> last(w, 0.0);
    for (int k = 0; k < 200; ++k) {
        for (size_t g = 0; g < w; ++g) {
            const oracle::Scale &s = group.model.scale[g];
            const double reach = random.chance(0.1) ? (s.maximum - s.minimum) : random.chance(0.5) ? 0.0 : random.real(0.0, 200.0);
            last[g] = std::clamp(std::round(last[g] + random.real(-reach, reach)), s.minimum, s.maximum);
            now[g]  = random.chance(vanish) ? oracle::Code() : oracle::Code(last[g]);
            code[g] = to_library(now[g]);
        }
        const bool speaks = sender.step(now);
        frames += speaks;
        if ((hg_trigger_step(&self, code.data()) == HG_OK) != speaks) { return say("k %d: the oracle says %s", k, speaks ? "send" : "silence"); }
    }
    return {};
}

void test_trigger(void **)
{
    Random      random = stream(4);
    std::string failure;
    long        frames = 0;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_trigger(random, frames);
        if (!failure.empty()) { failure = say("group %d: ", i) + failure; }
    }
    std::printf("trigger: %.1f %% of the samples sent\n", 100.0 * static_cast<double>(frames) / (200.0 * problems));
    expect_clean(failure);
}

/* Sender, lossy bus and receiver of one group. */
class Link {
public:
    Link(Random &random, const Group &group, int quiet_from)
        : random_(random), group_(group), quiet_from_(quiet_from), hold_(group.model), sender_memory_(group.width() + 1), memory_(2 * group.width() + 1),
          y_(group.width()), loss_(random.chance(0.3) ? 0.0 : random.real(0.0, 0.5)), known_(random.real(0.0, 1.0)),
          spurious_(random.chance(0.7) ? 0.0 : 0.03), vanish_(random.chance(0.7) ? 0.0 : 0.03), longest_outage_(random.chance(0.2) ? 200 : 12)
    {
        for (size_t g = 0; g < y_.size(); ++g) { y_[g] = static_cast<double>(group.middle[g]); }
    }
    std::string run(int samples);

    long frames = 0, lost_frames = 0, rewinds = 0, doubts = 0;

private:
    void        walk();
    std::string exchange(int k);
    std::string compare(int k);
    std::string sound() const;

    Random                   &random_;
    const Group              &group_;
    int                       quiet_from_; /* no loss from this sample on, so that the end is known */
    oracle::Hold              hold_;
    hg_trigger                trigger_{};
    hg_hold                   self_{};
    std::vector<std::int32_t> sender_memory_, memory_;
    std::vector<double>       y_;
    oracle::Table             truth_, value_, radius_; /* [sample][channel]; the library's, rewritten as it says */
    double                    loss_, known_, spurious_, vanish_;
    int                       longest_outage_, outage_ = 0, pace_ = 0;
    unsigned                  counter_ = 0, expected_ = 0;
    long                      last_good_ = -1;
    std::vector<double>       drift_;
};

/* Rest, ramps and noise, never faster than the slew table allows, never outside the range. */
void Link::walk()
{
    if (drift_.empty() || random_.chance(0.05)) {
        pace_ = random_.whole(0, 2);
        drift_.clear();
        for (size_t g = 0; g < y_.size(); ++g) { drift_.push_back(random_.chance(0.5) ? 1.0 : -1.0); }
    }
    for (size_t g = 0; g < y_.size(); ++g) {
        const oracle::Scale &s = group_.model.scale[g];
        const double move = pace_ == 0 ? 0.05 * random_.real(-1.0, 1.0) : pace_ == 1 ? drift_[g] : random_.real(-1.0, 1.0);
        y_[g] = std::clamp(y_[g] + move * group_.step[g], oracle::decode(s, s.minimum), oracle::decode(s, s.maximum));
    }
    truth_.push_back(y_);
}

/* One sample of sender and bus, the same for both receivers. */
std::string Link::exchange(int k)
{
    std::vector<std::int32_t> code(group_.width() + 1, 0);
    oracle::Codes             codes(group_.width());
    for (size_t g = 0; g < group_.width(); ++g) {
        const bool vanished = random_.chance(vanish_);
        code[g]  = hg_code_encode(&group_.scale[g], vanished ? std::numeric_limits<hg_real>::quiet_NaN() : nearest(y_[g]));
        codes[g] = from_library(code[g]);
        const oracle::Scale &s = group_.model.scale[g];
        if (vanished && codes[g]) { return "NaN has a code"; }
        if (codes[g] && !(std::abs(oracle::decode(s, *codes[g]) - y_[g]) <= static_cast<double>(group_.half[g]))) {
            return say("k %d: code %.0f of %.17g is off by more than half", k, *codes[g], y_[g]);
        }
    }
    const bool quiet = k >= quiet_from_;
    if (quiet) { outage_ = 0; }
    if (!quiet && random_.chance(spurious_)) { /* a damaged frame that was none of this sender's */
        hold_.lose();
        hg_hold_lose(&self_);
    }
    if (!quiet && outage_ == 0 && random_.chance(0.01)) { outage_ = random_.whole(1, longest_outage_); }
    if (hg_trigger_step(&trigger_, code.data()) == HG_OK) {
        const unsigned counter = counter_++ % 16U;
        const bool     lost    = !quiet && (outage_ > 0 || random_.chance(loss_));
        ++frames;
        if (lost) {
            ++lost_frames;
            if (random_.chance(known_)) {
                hold_.lose();
                hg_hold_lose(&self_);
            }
        } else {
            const bool continues = last_good_ < 0 ? random_.chance(0.5) : counter == expected_;
            expected_  = (counter + 1U) % 16U;
            last_good_ = k;
            hold_.receive({codes, continues});
            if (hg_hold_receive(&self_, code.data(), continues) != HG_OK) { return say("k %d: a frame refused", k); }
            if (random_.chance(0.05) && hg_hold_receive(&self_, code.data(), false) != HG_E_REPEATED) { return say("k %d: a second frame taken", k); }
            if (!quiet && random_.chance(spurious_)) {
                hold_.lose();
                hg_hold_lose(&self_);
            }
        }
    }
    outage_ = std::max(0, outage_ - 1);
    return {};
}

/* Step both receivers; the whole past must agree as it is known now, rewritten or not. */
std::string Link::compare(int k)
{
    const size_t w = group_.width();
    Reals        value(w + 1), radius(w + 1), past(w + 1);
    std::uint8_t rewind = 0;
    hold_.step();
    hg_hold_step(&self_, value.data(), radius.data(), &rewind);
    value_.emplace_back(value.begin(), value.end() - 1);
    radius_.emplace_back(radius.begin(), radius.end() - 1);
    for (int lag = 1; lag <= rewind; ++lag) {
        hg_hold_past(&self_, static_cast<std::uint8_t>(lag), past.data());
        if (lag <= k) { radius_[static_cast<size_t>(k - lag)].assign(past.begin(), past.end() - 1); }
    }
    rewinds += hold_.rewound();
    doubts  += hold_.doubt();
    const int from = (hold_.rewound() || rewind > 0) ? 0 : k;
    for (int j = from; j <= k; ++j) {
        for (size_t g = 0; g < w; ++g) {
            const oracle::Scale &s = group_.model.scale[g];
            const size_t at    = static_cast<size_t>(j);
            const double v     = hold_.values()[at][g], r = hold_.radii()[at][g];
            const double v_tol = 4.0 * unit * (std::abs(s.offset) + std::abs(v - s.offset)); /* one product, one sum */
            if (!(std::abs(value_[at][g] - v) <= v_tol)) { return say("k %d, sample %d: value %.17g, oracle %.17g", k, j, value_[at][g], v); }
            if (!(std::abs(radius_[at][g] - r) <= 4.0 * unit * r)) {
                return say("k %d, sample %d, channel %zu: radius %.17g, oracle %.17g (rewind %d, oracle %d, last frame %ld, half %g, span %g)", k, j, g,
                           radius_[at][g], r, rewind, hold_.rewound(), last_good_, group_.model.half[g], group_.model.span[g]);
            }
        }
    }
    if (hg_hold_doubt(&self_) != hold_.doubt()) { return say("k %d: doubt %d, oracle %d, last frame %ld", k, hg_hold_doubt(&self_), hold_.doubt(), last_good_); }
    if (static_cast<int>(hg_hold_health(&self_)) != static_cast<int>(hold_.health())) {
        return say("k %d: health %d, oracle %d, last frame %ld", k, static_cast<int>(hg_hold_health(&self_)), static_cast<int>(hold_.health()), last_good_);
    }
    return {};
}

/* The one promise that matters: |true - value| <= radius, once the frame after a sample has settled it. */
std::string Link::sound() const
{
    for (size_t k = 0; k <= static_cast<size_t>(last_good_); ++k) {
        for (size_t g = 0; g < group_.width(); ++g) {
            if (!(std::abs(truth_[k][g] - value_[k][g]) <= radius_[k][g])) {
                return say("sample %zu, channel %zu: |%.17g - %.17g| > %.17g", k, g, truth_[k][g], value_[k][g], radius_[k][g]);
            }
        }
    }
    return {};
}

std::string Link::run(int samples)
{
    std::string failure;
    if (hg_trigger_start(&trigger_, &group_.trigger, sender_memory_.data()) != HG_OK) { return "sender refused"; }
    if (hg_hold_start(&self_, &group_.hold, memory_.data()) != HG_OK) { return "hold refused"; }
    for (int k = 0; k < samples && failure.empty(); ++k) {
        walk();
        failure = exchange(k);
        if (failure.empty()) { failure = compare(k); }
    }
    return failure.empty() ? sound() : failure;
}

void test_hold(void **)
{
    Random      random = stream(5);
    std::string failure;
    long        frames = 0, lost = 0, rewinds = 0, doubts = 0;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        const Group group(random, random.chance(0.1));
        Link        link(random, group, 400);
        failure = link.run(400 + 2 * group.trigger.interval_max + 2);
        if (!failure.empty()) { failure = say("group %d (width %zu, levels %d, interval_max %d, margin %d): ", i, group.width(), group.trigger.levels,
                                              group.trigger.interval_max, group.hold.margin) + failure; }
        frames += link.frames;
        lost += link.lost_frames;
        rewinds += link.rewinds;
        doubts += link.doubts;
    }
    std::printf("hold: %ld frames, %ld lost, %ld rewinds, %ld samples in doubt\n", frames, lost, rewinds, doubts);
    expect_clean(failure);
}

/* ---- d) The decision ---- */

/* Evidence as a bus can bring it: doubt lasts until the group's next frame, and only that frame can rewind. */
class Witness {
public:
    Witness(Random &random, int groups, int generators) : random_(random), groups_(groups), generators_(generators) {}
    oracle::Evidence next()
    {
        oracle::Evidence e;
        if (random_.chance(0.05)) { calm_ = random_.real(0.0, 1.0); }
        if (random_.chance(0.1)) { ready_ = random_.chance(0.8); }
        for (int i = 0; i < groups_; ++i) {
            const unsigned bit = 1U << i;
            if (random_.chance(0.35)) { /* a frame */
                if (random_.chance((doubt_ & bit) != 0 ? 0.3 : 0.02)) { e.rewound |= bit; }
                doubt_ &= ~bit;
            } else if (random_.chance(0.6)) {
                doubt_ |= bit;
            }
        }
        e.doubt = doubt_;
        e.ready = ready_;
        for (int g = 0; g < generators_; ++g) { e.alarm.push_back(random_.chance(calm_)); }
        return e;
    }

private:
    Random  &random_;
    int      groups_, generators_;
    double   calm_  = 0.3;
    bool     ready_ = false;
    unsigned doubt_ = 0;
};

std::string one_decision(Random &random, std::vector<long> &seen)
{
    const int     groups = random.whole(1, 8), generators = random.whole(1, random.chance(0.2) ? HG_GENERATORS_MAX : 4);
    oracle::Rules rules;
    std::vector<std::uint8_t> feeds;
    for (int g = 0; g < generators; ++g) {
        rules.feeds.push_back(static_cast<unsigned>(random.integer(0, (1 << groups) - 1)));
        rules.faults.push_back(static_cast<std::uint32_t>(random.integer(0, 0xFFFFFFFFLL)));
        feeds.push_back(static_cast<std::uint8_t>(rules.feeds.back()));
    }
    rules.up    = random.chance(0.5) ? 1 : random.whole(1, 6);
    rules.down  = random.chance(0.3) ? 1 : random.whole(1, 10);
    rules.latch = random.chance(0.2);
    const hg_decision_config config{static_cast<std::uint8_t>(generators), feeds.data(), rules.faults.data(), static_cast<std::uint8_t>(rules.up),
                                    static_cast<std::uint8_t>(rules.down), rules.latch};
    std::vector<hg_alarm> memory(static_cast<size_t>(generators));
    hg_decision           self{};
    if (hg_decision_start(&self, &config, memory.data()) != HG_OK) { return "start refused"; }
    oracle::Decision decision(rules);
    Witness          witness(random, groups, generators);
    for (int k = 0; k < 300; ++k) {
        if (random.chance(0.003)) {
            hg_decision_reset(&self);
            decision.reset();
        }
        const oracle::Evidence e = witness.next();
        hg_evidence            evidence{0, e.ready, static_cast<std::uint8_t>(e.doubt), static_cast<std::uint8_t>(e.rewound)};
        for (size_t g = 0; g < e.alarm.size(); ++g) { evidence.alarm |= e.alarm[g] ? (1U << g) : 0U; }
        std::uint32_t       candidates = 0;
        const hg_plant      plant    = hg_decision_step(&self, &evidence, &candidates);
        const oracle::State expected = decision.step(e);
        ++seen[static_cast<size_t>(expected)];
        if (static_cast<int>(plant) != static_cast<int>(expected)) {
            return say("k %d (up %d, down %d, latch %d, generators %d, feeds %x): plant %d, oracle %d; alarm %x ready %d doubt %x rewound %x", k, rules.up, rules.down,
                       rules.latch, generators, rules.feeds[0], static_cast<int>(plant), static_cast<int>(expected), evidence.alarm, evidence.ready,
                       evidence.doubt, evidence.rewound);
        }
        if (candidates != decision.candidates()) {
            return say("k %d (up %d, down %d, latch %d, generators %d): candidates %x, oracle %x; plant %d alarm %x ready %d doubt %x rewound %x", k, rules.up,
                       rules.down, rules.latch, generators, candidates, decision.candidates(), static_cast<int>(plant), evidence.alarm, evidence.ready,
                       evidence.doubt, evidence.rewound);
        }
    }
    return {};
}

void test_decision(void **)
{
    Random            random = stream(6);
    std::vector<long> seen(4, 0);
    std::string       failure;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_decision(random, seen);
        if (!failure.empty()) { failure = say("decision %d: ", i) + failure; }
    }
    std::printf("decision: %ld starting, %ld none, %ld provisional, %ld confirmed\n", seen[0], seen[1], seen[2], seen[3]);
    expect_clean(failure);
}

/* ---- The whole detector ---- */

/* A plant with one or two observers, its signals in random order in one to three groups, over a bus that loses frames. The oracle's holds,
 *  cascades and thresholds run beside hg_detector; and while there is no fault nothing may be confirmed, whatever the bus does. */
class Chain {
public:
    Chain(Random &random, long &confirmed);
    Chain(const Chain &) = delete;
    Chain &operator=(const Chain &) = delete;
    std::string run();

private:
    static constexpr int samples_ = 240, fault_ = 160; /* an actuator fault from this sample on */
    struct Observer {
        Loop                      loop;
        System                    system;
        Vector                    rounding;
        Tail                      tail;
        Matrix                    exact; /* bias by sample, of the start that this run has */
        Bias                      start;
        std::optional<oracle::Cascade> cascade;
        std::optional<oracle::Hull>    hull;
        std::optional<Residual>        residual;
        std::optional<HullTables>      tables;
    };
    void        drive();
    void        build_groups();
    void        build(Observer &o);
    void        connect();
    void        transmit(size_t group, int k);
    std::string judge(int k);
    double      handed_over(const Observer &o, int k, Eigen::Index i) const;
    std::string compare(Observer &o, size_t at, int k, bool &alarm) const;

    Random                            &random_;
    long                              &confirmed_;
    Loop                               first_;
    bool                               rest_;
    double                             loss_, known_;
    oracle::Table                      course_; /* [sample][column]: readings y, then u as it is measured */
    std::vector<std::uint8_t>          place_;  /* [column] in the signal vector */
    std::vector<std::unique_ptr<Group>>  groups_;
    std::vector<size_t>                  group_first_;
    std::vector<std::unique_ptr<oracle::Hold>> holds_;
    std::vector<hg_trigger>            senders_;
    std::vector<std::vector<std::int32_t>> sender_memory_;
    std::vector<unsigned>              counter_, expected_;
    std::vector<std::unique_ptr<Observer>> observers_;

    oracle::Rules                      rules_;
    std::optional<oracle::Decision>    decision_;
    std::vector<hg_hold_config>        hold_config_;
    std::vector<hg_residual_config>    residual_config_;
    std::vector<hg_hull_config>        hull_config_;
    std::vector<std::uint8_t>          feeds_;
    std::vector<hg_hold>               hold_memory_;
    std::vector<hg_residual>           residual_memory_;
    std::vector<hg_hull>               hull_memory_;
    std::vector<hg_alarm>              alarm_memory_;
    std::vector<std::int32_t>          code_memory_;
    Reals                              real_memory_;
    hg_detector_config                 config_{};
    hg_detector                        self_{};
};

Chain::Chain(Random &random, long &confirmed)
    : random_(random), confirmed_(confirmed), first_(random_loop(random)), rest_(random.chance(0.5)), loss_(random.real(0.0, 0.4)),
      known_(random.real(0.0, 1.0))
{
    drive();
    build_groups();
    for (int i = random.whole(1, 2); i > 0; --i) {
        observers_.push_back(std::make_unique<Observer>());
        observers_.back()->loop = first_;
        if (i == 2) { draw_observer(random, observers_.back()->loop); }
        build(*observers_.back());
    }
    connect();
}

/* Manoeuvres: steps of the input, disturbances and noise within their bounds, an actuator fault at the end. */
void Chain::drive()
{
    const oracle::Plant &p = first_.plant;
    const Eigen::Index   m = p.C.rows(), inputs = p.B.cols();
    Vector x = first_.initial, u = Vector::Zero(inputs), fault = 2.0 * random_.matrix(inputs, 1);
    if (!rest_) { x *= 2.0; }
    for (Eigen::Index i = 0; i < x.size(); ++i) { x(i) *= random_.real(-1.0, 1.0); }
    for (int k = 0; k < samples_; ++k) {
        if (random_.chance(0.05)) { u = random_.matrix(inputs, 1); }
        const Vector d = random_.matrix(p.Ed.cols(), 1), real_u = (k >= fault_) ? Vector(u + fault) : u;
        const Vector y = p.C * x + p.D * real_u + p.Fd * d;
        x = p.A * x + p.B * real_u + p.Ed * d;
        std::vector<double> row(y.data(), y.data() + m);
        row.insert(row.end(), u.data(), u.data() + inputs);
        course_.push_back(row);
    }
}

void Chain::build_groups()
{
    const auto width = static_cast<Eigen::Index>(course_[0].size());
    place_ = random_places(random_, width, width);
    const int count = random_.whole(1, std::min(3, static_cast<int>(width)));
    size_t    first = 0;
    for (int i = 0; i < count; ++i) {
        const size_t after = (i == count - 1) ? place_.size() : first + 1 + static_cast<size_t>(random_.whole(0, static_cast<int>(place_.size() - first) - (count - i)));
        oracle::Table part(course_.size());
        for (size_t k = 0; k < course_.size(); ++k) {
            for (size_t at = first; at < after; ++at) {
                const auto column = std::find(place_.begin(), place_.end(), static_cast<std::uint8_t>(at)) - place_.begin();
                part[k].push_back(course_[k][static_cast<size_t>(column)]);
            }
        }
        groups_.push_back(std::make_unique<Group>(random_, part));
        holds_.push_back(std::make_unique<oracle::Hold>(groups_.back()->model));
        group_first_.push_back(first);
        first = after;
    }
}

/* What a tail must hold at sample `settle`, so that it and `later` together are never below `bias` (samples x residuals). */
Vector left_of(const Matrix &bias, const Vector &later, const Tail &tail, int settle)
{
    Vector left = Vector::Zero(later.size());
    for (Eigen::Index k = settle; k < bias.rows(); ++k) {
        for (Eigen::Index i = 0; i < later.size(); ++i) {
            const double above = bias(k, i) - later(i);
            left(i) = (above > 0.0) ? std::max(left(i), above / std::pow(tail.decay(i), k - settle)) : left(i);
        }
    }
    return left;
}

/* Tables of one generator: bias by the error system, a rounding bound for values up to three times the readings, taps of each signal that reach
 *  back as far as its hold can rewrite. */
void Chain::build(Observer &o)
{
    Vector in_max = Vector::Zero(static_cast<Eigen::Index>(place_.size())), z_max = Vector::Zero(o.loop.generator.G.rows());
    oracle::Cascade run(o.loop.generator);
    const Eigen::Index m = o.loop.generator.V.cols();
    for (const auto &row : course_) {
        const Vector in = Eigen::Map<const Vector>(row.data(), static_cast<Eigen::Index>(row.size()));
        in_max = in_max.cwiseMax(in.cwiseAbs());
        run.step(in.head(m), in.tail(in.size() - m));
        z_max = z_max.cwiseMax((run.observer() + run.filter()).cwiseAbs());
    }
    o.system   = fused(o.loop.generator);
    o.rounding = rounding(o.system, m, 3.0 * z_max, 3.0 * in_max, unit);
    Taps taps;
    for (const std::uint8_t place : place_) {
        const auto after = std::upper_bound(group_first_.begin(), group_first_.end(), static_cast<size_t>(place));
        taps.push_back(random_.whole(groups_[static_cast<size_t>(after - group_first_.begin()) - 1]->trigger.interval_max, 90));
    }
    o.tail = tail_of(random_, o.system, taps);
    Loop wide = o.loop;
    wide.initial *= 2.0; /* the state range */
    const int    settle = random_.whole(1, samples_ - 1);
    const Matrix rest = bias_by_error(o.loop, samples_ + 1), moving = bias_by_error(wide, samples_ + 1);
    const Vector later = moving.bottomRows(random_.whole(1, 40)).colwise().maxCoeff().transpose();
    o.exact = rest_ ? rest : moving;
    o.start = {rest.topRows(settle), moving.topRows(settle), left_of(rest, later, o.tail, settle), left_of(moving, later, o.tail, settle), later + o.rounding};
    o.start.rest.rowwise() += o.rounding.transpose();
    o.start.moving.rowwise() += o.rounding.transpose();
    o.residual.emplace(o.system, place_);
    o.tables.emplace(o.system, place_, taps, o.start, o.tail, 10, 10);
    if (!rest_) { o.loop = wide; }
    o.cascade.emplace(o.loop.generator);
    o.hull.emplace(o.loop.generator, o.loop.plant, o.loop.initial);
}

void Chain::connect()
{
    std::uint8_t history = 0;
    std::uint16_t residuals = 0;
    for (const auto &o : observers_) {
        residual_config_.push_back(o->residual->config);
        hull_config_.push_back(o->tables->config);
        history = std::max(history, static_cast<std::uint8_t>(*std::max_element(o->tables->taps.begin(), o->tables->taps.end()) + 1));
        residuals = static_cast<std::uint16_t>(residuals + o->residual->config.residuals);
        rules_.feeds.push_back((1U << groups_.size()) - 1U);
        rules_.faults.push_back(static_cast<std::uint32_t>(random_.integer(1, 255)));
        feeds_.push_back(static_cast<std::uint8_t>(rules_.feeds.back()));
    }
    rules_.down = random_.whole(1, 5);
    decision_.emplace(rules_);
    for (const auto &g : groups_) {
        hold_config_.push_back(g->hold);
        sender_memory_.emplace_back(g->width());
        senders_.emplace_back();
        hg_trigger_start(&senders_.back(), &g->trigger, sender_memory_.back().data());
    }
    counter_.assign(groups_.size(), 0U);
    expected_ = counter_;
    const auto signals = static_cast<std::uint8_t>(place_.size()), groups = static_cast<std::uint8_t>(groups_.size());
    const auto generators = static_cast<std::uint8_t>(observers_.size());
    config_.signals    = signals;
    config_.width      = signals; /* nothing is derived */
    config_.groups     = groups;
    config_.hold       = hold_config_.data();
    config_.generators = generators;
    config_.residual   = residual_config_.data();
    config_.hull       = hull_config_.data();
    config_.decision   = {generators, feeds_.data(), rules_.faults.data(), 1, static_cast<std::uint8_t>(rules_.down), false};
    config_.history    = history;
    config_.residuals  = residuals;
    config_.codes      = static_cast<std::uint16_t>(2 * signals);
    config_.reals = hg_detector_reals(&config_);
    hold_memory_.resize(groups);
    residual_memory_.resize(generators);
    hull_memory_.resize(generators);
    alarm_memory_.resize(generators);
    code_memory_.resize(config_.codes);
    real_memory_.resize(config_.reals);
}

/* One group's sender and bus, the same frames for both sides. */
void Chain::transmit(size_t group, int k)
{
    const Group              &g = *groups_[group];
    std::vector<std::int32_t> code;
    oracle::Codes             codes;
    for (size_t c = 0; c < g.width(); ++c) {
        const auto column = std::find(place_.begin(), place_.end(), static_cast<std::uint8_t>(group_first_[group] + c)) - place_.begin();
        code.push_back(hg_code_encode(&g.scale[c], nearest(course_[static_cast<size_t>(k)][static_cast<size_t>(column)])));
        codes.push_back(from_library(code.back()));
    }
    if (hg_trigger_step(&senders_[group], code.data()) != HG_OK) { return; }
    const unsigned counter = counter_[group]++ % 16U;
    const auto     index   = static_cast<std::uint8_t>(group);
    if (random_.chance(loss_)) {
        if (random_.chance(known_)) {
            holds_[group]->lose();
            hg_detector_lose(&self_, index);
        }
        return;
    }
    const bool continues = counter == expected_[group];
    expected_[group] = (counter + 1U) % 16U;
    holds_[group]->receive({codes, continues});
    hg_detector_receive(&self_, index, code.data(), continues);
}

/* What table and tail say of the initial state and the disturbances beyond what they do. */
double Chain::handed_over(const Observer &o, int k, Eigen::Index i) const
{
    const int settle = static_cast<int>(o.start.rest.rows());
    if (k < settle) { return 0.0; }
    const double left = (rest_ ? o.start.rest_left : o.start.moving_left)(i) * std::pow(o.tail.decay(i), k - settle);
    return o.start.later(i) - o.rounding(i) + left - o.exact(k, i);
}

/* r and J of one generator against the oracle's cascade and full-history hull over the radii as they are known now. */
std::string Chain::compare(Observer &o, size_t at, int k, bool &alarm) const
{
    const Eigen::Index  m = o.loop.generator.V.cols(), width = static_cast<Eigen::Index>(place_.size());
    std::vector<Vector> radius(static_cast<size_t>(k + 1), Vector(width)), y, u;
    Vector              value(width);
    double              widest = 0.0;
    for (Eigen::Index c = 0; c < width; ++c) {
        const size_t place = place_[static_cast<size_t>(c)];
        size_t       group = groups_.size() - 1;
        while (group_first_[group] > place) { --group; }
        value(c) = holds_[group]->value()[place - group_first_[group]];
        for (size_t j = 0; j <= static_cast<size_t>(k); ++j) {
            radius[j](c) = holds_[group]->radii()[j][place - group_first_[group]];
            widest       = std::max(widest, radius[j](c));
        }
    }
    for (const Vector &row : radius) {
        y.push_back(row.head(m));
        u.push_back(row.tail(width - m));
    }
    const Vector r = o.cascade->step(value.head(m), value.tail(width - m)), J = o.hull->threshold(y, u);
    for (Eigen::Index i = 0; i < r.size(); ++i) {
        const double lib_r = static_cast<double>(self_.r[at + static_cast<size_t>(i)]), lib_J = static_cast<double>(self_.J[at + static_cast<size_t>(i)]);
        const double tail  = o.tail.weight.row(i).sum() * widest / (1.0 - o.tail.decay(i)) + handed_over(o, k, i);
        if (!(std::abs(lib_r - r(i)) <= o.rounding(i) + 1e-12)) { return say("k %d: r %.17g, oracle %.17g", k, lib_r, r(i)); }
        if (!(lib_J >= J(i) * (1.0 - 1e-12))) { return say("k %d: J %.17g below the exact hull %.17g", k, lib_J, J(i)); }
        if (!(lib_J <= (J(i) + o.rounding(i) + 1.1 * tail) * 1.01)) { return say("k %d: J %.17g, exact %.17g, tail at most %g", k, lib_J, J(i), tail); }
        alarm = alarm || std::abs(lib_r) > lib_J; /* the library's numbers: a tie may fall either way within rounding */
    }
    return {};
}

std::string Chain::judge(int k)
{
    hg_finding finding{};
    if (hg_detector_step(&self_, &finding) != HG_OK) { return say("k %d: step refused", k); }
    oracle::Evidence evidence;
    evidence.ready = k + 1 >= 10;
    for (size_t g = 0; g < groups_.size(); ++g) {
        holds_[g]->step();
        evidence.doubt |= static_cast<unsigned>(holds_[g]->doubt()) << g;
        evidence.rewound |= static_cast<unsigned>(holds_[g]->rewound()) << g;
        if (static_cast<int>(hg_hold_health(&hold_memory_[g])) != static_cast<int>(holds_[g]->health())) { return say("k %d: health of group %zu", k, g); }
    }
    size_t at = 0;
    for (const auto &o : observers_) {
        bool              alarm = false;
        const std::string failure = compare(*o, at, k, alarm);
        if (!failure.empty()) { return failure; }
        evidence.alarm.push_back(alarm);
        at += o->residual->config.residuals;
    }
    const oracle::State state = decision_->step(evidence);
    if (k < fault_ && finding.plant == HG_PLANT_CONFIRMED) { return say("k %d: a false alarm is confirmed", k); }
    if (static_cast<int>(finding.plant) != static_cast<int>(state)) {
        return say("k %d (down %d): plant %d, oracle %d", k, rules_.down, static_cast<int>(finding.plant), static_cast<int>(state));
    }
    if (finding.candidates != decision_->candidates()) { return say("k %d: candidates %x, oracle %x", k, finding.candidates, decision_->candidates()); }
    confirmed_ += state == oracle::State::confirmed;
    return {};
}

std::string Chain::run()
{
    hg_detector_memory memory{};
    memory.hold     = hold_memory_.data();
    memory.residual = residual_memory_.data();
    memory.hull     = hull_memory_.data();
    memory.alarm    = alarm_memory_.data();
    memory.code     = code_memory_.data();
    memory.codes    = config_.codes;
    memory.real     = real_memory_.data();
    memory.reals    = config_.reals;
    if (hg_detector_start(&self_, &config_, &memory, rest_ ? HG_START_REST : HG_START_MOVING) != HG_OK) { return "start refused"; }
    std::string failure;
    for (int k = 0; k < samples_ && failure.empty(); ++k) {
        for (size_t g = 0; g < groups_.size(); ++g) { transmit(g, k); }
        failure = judge(k);
    }
    return failure;
}

/* ---- e) A bank of certificates over rings whose past is rewritten ---- */

struct BankTables {
    std::vector<oracle::Certificate> certificates;
    std::vector<std::uint8_t>        signal, extra;
    Reals                            weight, extra_weight, bias;
    hg_bank_config                   config{};
    int                              values, radii;

    explicit BankTables(Random &random)
    {
        const int window = random.whole(1, 40), count = random.whole(1, 20), width = random.whole(1, 6), extras = random.whole(0, 3);
        values = width + random.whole(0, 3);
        radii  = values + extras + random.whole(0, 2);
        signal = random_places(random, width, values);
        if (extras > 0) { extra = random_places(random, extras, radii - values); }
        for (std::uint8_t &e : extra) { e = static_cast<std::uint8_t>(e + values); } /* derived signals come behind the sent ones */
        const double widen = static_cast<double>(round_up(random.chance(0.5) ? 1.0 : random.real(1.0, 1.5)));
        for (int c = 0; c < count; ++c) {
            certificates.push_back({Matrix::Zero(window, values), Matrix::Zero(window, radii), static_cast<double>(nearest(random.real(1e-3, 1.0)))});
            bias.push_back(nearest(certificates.back().bias));
        }
        for (int lag = 0; lag < window; ++lag) {
            fill(random, lag, signal, weight, [](oracle::Certificate &c) -> Matrix & { return c.weight; }, -1.0);
            fill(random, lag, extra, extra_weight, [](oracle::Certificate &c) -> Matrix & { return c.extra; }, 0.0);
        }
        config = {static_cast<std::uint8_t>(count), static_cast<std::uint8_t>(window), static_cast<std::uint8_t>(width), signal.data(), 0, weight.data(),
                  static_cast<std::uint8_t>(extras), extra.data(), extra_weight.data(), bias.data(), nearest(widen)};
    }

private:
    template <class Part> void fill(Random &random, int lag, const std::vector<std::uint8_t> &places, Reals &table, Part part, double least)
    {
        for (const std::uint8_t place : places) {
            for (oracle::Certificate &c : certificates) {
                const hg_real w = nearest(random.chance(0.2) ? 0.0 : random.real(least, 1.0));
                part(c)(lag, place) = static_cast<double>(w);
                table.push_back(w);
            }
        }
    }
};

struct BankCount {
    int alarms = 0, quiet = 0, empty = 0;
};

/* What the library says of one sample, held against every certificate. */
std::string judge_bank(const hg_bank &self, const oracle::Bank &bank, const BankTables &tables, double r, double J, BankCount &count)
{
    const double share = unit * (static_cast<double>(tables.config.window) * (tables.config.width + tables.config.extras + 1.0) + 8.0);
    const double own_r = bank.residual(self.closest), own_J = bank.threshold(self.closest);
    if (!(std::abs(r - own_r) <= share * bank.moved(self.closest))) { return say("certificate %d: r %.17g, oracle %.17g", self.closest, r, own_r); }
    if (!(std::abs(J - own_J) <= share * own_J)) { return say("certificate %d: J %.17g, oracle %.17g", self.closest, J, own_J); }
    const bool alarm = std::abs(r) > J;
    (alarm ? count.alarms : count.quiet)++;
    for (size_t c = 0; c < tables.certificates.size(); ++c) {
        const double other = std::abs(bank.residual(c)), limit = bank.threshold(c), slack = share * (bank.moved(c) + limit);
        if (!alarm && other > limit + slack) { return say("certificate %zu alarms, |r| %.17g > %.17g, the bank does not", c, other, limit); }
        if (alarm != (other > limit) && std::abs(other - limit) > slack) { continue; } /* the nearest is an alarm where there is one */
        if (other / limit > (std::abs(own_r) / own_J) * (1.0 + share) + 2.0 * slack / limit + 2.0 * share * bank.moved(self.closest) / own_J) {
            return say("certificate %zu has |r| / J %.17g, the bank chose %d with %.17g", c, other / limit, self.closest, std::abs(own_r) / own_J);
        }
    }
    return {};
}

std::string one_bank(Random &random, BankCount &count)
{
    const BankTables    tables(random);
    const int           length = tables.config.window + random.whole(0, 5);
    Reals               value_memory(static_cast<size_t>(tables.values * length)), radius_memory(static_cast<size_t>(tables.radii * length));
    std::vector<hg_acc> sums(HG_BANK_SUMS(tables.config.certificates));
    hg_ring             value{}, radius{};
    hg_bank             self{};
    const auto          values = static_cast<std::uint8_t>(tables.values), radii = static_cast<std::uint8_t>(tables.radii), rows = static_cast<std::uint8_t>(length);
    if (!hg_bank_valid(&tables.config, values, radii, rows) || hg_ring_start(&value, values, rows, value_memory.data()) != HG_OK ||
        hg_ring_start(&radius, radii, rows, radius_memory.data()) != HG_OK || hg_bank_start(&self, &tables.config, sums.data()) != HG_OK) {
        return "start refused";
    }
    oracle::Bank     bank(tables.certificates, static_cast<double>(tables.config.widen));
    const double     size = random.real(0.1, 4.0);
    std::vector<int> mode(static_cast<size_t>(tables.radii), 1);
    Reals            v(static_cast<size_t>(tables.values)), w(static_cast<size_t>(tables.radii));
    for (int k = 0; k < 120; ++k) {
        if (random.chance(0.01)) {
            hg_bank_reset(&self);
            bank.reset();
        }
        for (hg_real &x : v) { x = nearest(size * random.real(-1.0, 1.0)); }
        random_radii(random, w, mode);
        if (hg_ring_push(&value, v.data()) != HG_OK || hg_ring_push(&radius, w.data()) != HG_OK) { return "push refused"; }
        Vector held(tables.values), wide(tables.radii);
        for (Eigen::Index i = 0; i < held.size(); ++i) { held(i) = static_cast<double>(v[static_cast<size_t>(i)]); }
        for (Eigen::Index i = 0; i < wide.size(); ++i) { wide(i) = static_cast<double>(w[static_cast<size_t>(i)]); }
        bank.step(held, wide);
        for (int lag = 1; random.chance(0.05) && lag < length && lag < bank.samples(); ++lag) { /* the past turns out to be worse than thought */
            const int     place = random.whole(0, tables.radii - 1);
            const hg_real wider = nearest(random.real(0.0, 5.0));
            hg_ring_rewrite(&radius, static_cast<std::uint8_t>(lag), static_cast<std::uint8_t>(place), 1U, &wider);
            bank.radius(lag)(place) = static_cast<double>(wider);
        }
        hg_real         r = nearest(9.0), J = nearest(9.0);
        const hg_status status = hg_bank_step(&self, &value, &radius, &r, &J);
        if (hg_bank_ready(&self) != bank.ready() || (status == HG_OK) != bank.ready()) { return say("k %d: status %d, oracle ready %d", k, static_cast<int>(status), bank.ready()); }
        if (!bank.ready()) {
            ++count.empty;
            if (status != HG_E_EMPTY || std::abs(static_cast<double>(r)) > 0.0 || J != tables.bias[0]) { return say("k %d: output before the window is full", k); }
            continue;
        }
        const std::string wrong = judge_bank(self, bank, tables, static_cast<double>(r), static_cast<double>(J), count);
        if (!wrong.empty()) { return say("k %d: ", k) + wrong; }
    }
    return {};
}

void test_bank(void **)
{
    Random      random = stream(8);
    BankCount   count;
    std::string failure;
    for (int i = 0; i < problems / 5 && failure.empty(); ++i) {
        failure = one_bank(random, count);
        if (!failure.empty()) { failure = say("bank %d: ", i) + failure; }
    }
    std::printf("bank: %d alarms, %d samples without, %d with a window that is not full\n", count.alarms, count.quiet, count.empty);
    if (failure.empty() && std::min({count.alarms, count.quiet, count.empty}) < problems) { failure = "too few cases of a kind"; }
    expect_clean(failure);
}

/* ---- The unknown-input observer (suspension, sections 1.1 and 1.4) ---- */

struct UnknownInput {
    oracle::UnknownInputPlant plant;
    Matrix                    K1;
    double                    sample_time = 0.0;
    Vector                    low;
};

/* In coordinates x = [hidden; y] with G = [0; G2], A1 = (I - HC) A leaves the hidden rows of A as they are: they are the invariant zeros, stable because A
 *  is diagonally dominant, and K1 cancels their coupling and puts the other poles where it likes. Then seen from a random basis. */
UnknownInput random_unknown_input(Random &random)
{
    const int    n = random.whole(2, 8), q = random.whole(1, std::min(3, n)), m = random.whole(q, n), p = random.whole(1, 2), h = n - m;
    UnknownInput u;
    const Matrix A = random.matrix(n, n) - (n + 0.5) * Matrix::Identity(n, n);
    Matrix       G = Matrix::Zero(n, q), C = Matrix::Zero(m, n), K1(n, m), T = random.matrix(n, n) + 3.0 * Matrix::Identity(n, n);
    Matrix       G2 = random.matrix(m, q);
    G2.topRows(q) += 2.0 * Matrix::Identity(q, q);
    G.bottomRows(m) = G2;
    C.rightCols(m) = Matrix::Identity(m, m);
    const Matrix P = Matrix::Identity(m, m) - G2 * (G2.transpose() * G2).inverse() * G2.transpose();
    Vector       poles(m);
    for (Eigen::Index i = 0; i < m; ++i) { poles(i) = random.real(0.5, 8.0); }
    K1.topRows(h) = A.topRightCorner(h, m);
    K1.bottomRows(m) = P * A.bottomRightCorner(m, m) + Matrix(poles.asDiagonal());
    while (std::abs(T.determinant()) < 0.1) { T += Matrix::Identity(n, n); }
    u.plant = {T * A * T.inverse(), T * random.matrix(n, p), T * G, C * T.inverse()};
    u.K1 = T * K1;
    u.sample_time = random.real(0.01, 0.1);
    u.low = Vector(q);
    for (Eigen::Index i = 0; i < q; ++i) { u.low(i) = random.chance(0.2) ? 1.0 : random.real(0.05, 0.9); }
    return u;
}

/* uio.h: s, g -> fhat, xhat */
System estimator(const oracle::UnknownInputObserver &o, const Vector &low)
{
    const Eigen::Index n = o.Fd.rows(), q = low.size(), m = o.H.cols(), p = o.Bd.cols();
    const Matrix a = low.asDiagonal(), keep = Matrix::Identity(q, q) - a, direct = o.K1d + o.H;
    const Matrix N = keep * a * o.inverse - a * o.inverse * o.Ad;
    Matrix       A(n + q, n + q), B(n + q, m + p), C(q + n, n + q), D(q + n, m + p);
    A << o.Fd, Matrix::Zero(n, q), N, keep;
    B << o.Fd * o.K1d + o.K0, o.Bz, N * direct, -a * o.inverse * o.Bd;
    C << a * o.inverse, Matrix::Identity(q, q), Matrix::Identity(n, n), Matrix::Zero(n, q);
    D << a * o.inverse * direct, Matrix::Zero(q, p), direct, Matrix::Zero(n, p);
    return plain(A, B, C, D);
}

/* A theta for each eigenvalue; hull.h */
struct Modes {
    Vector decay;
    Matrix input, output; /* modes x width, estimates x modes */
    Reals  decay_table, input_table, output_table, none;

    Modes(const System &s, int taps)
    {
        const Eigen::EigenSolver<Matrix> eigen(s.A);
        const Eigen::MatrixXcd           S = eigen.eigenvectors();
        const double                     widen = 1.0 + unit * (10.0 + static_cast<double>(s.B.cols() + s.A.rows()));
        decay  = eigen.eigenvalues().cwiseAbs();
        input  = (S.inverse() * s.B).cwiseAbs();
        output = (s.C * S).cwiseAbs() * Vector(decay.array().pow(taps - 1)).asDiagonal();
        HullTables::append(decay_table, decay.transpose() * (1.0 + 8.0 * unit));
        HullTables::append(input_table, input * widen);
        HullTables::append(output_table, output * widen);
        none.assign(static_cast<size_t>(decay.size()), static_cast<hg_real>(0));
    }
    void into(hg_hull_config &config) const
    {
        config.modes = static_cast<std::uint8_t>(decay.size());
        config.mode_decay = decay_table.data();
        config.mode_input = input_table.data();
        config.mode_output = output_table.data();
        config.mode_rest = config.mode_moving = none.data();
    }
};

struct UioCount {
    int    observers = 0;
    double wrong = 0.0; /* largest difference over its tolerance */
    double wide  = 0.0; /* sum of the logarithms of radius over exact, */
    double common = 0.0; /* the same with one decay for all modes, */
    int    radii = 0;   /* and how many */
};

/* One observer in the library beside the oracle's. */
struct Estimating {
    System           system;
    Residual         residual;
    Tail             no_tail;
    HullTables       hull;
    Modes            modes;
    hg_uio_config    config{};
    hg_uio           self{};
    hg_ring          ring{};
    Reals            ring_memory, memory;

    Estimating(const System &s, const std::vector<std::uint8_t> &places, Eigen::Index all, Eigen::Index q, int taps)
        : system(s), residual(s, places), no_tail{0.0, Vector::Zero(s.C.rows()), Vector::Zero(s.B.cols()), true},
          hull(s, places, taps, Matrix::Zero(1, s.C.rows()), Matrix::Zero(1, s.C.rows()), no_tail, 0, 0), modes(s, taps)
    {
        config.actuators = static_cast<std::uint8_t>(q);
        config.states = static_cast<std::uint8_t>(s.C.rows() - q);
        config.observer = residual.config;
        config.hull = hull.config;
        modes.into(config.hull);
        ring_memory.resize(static_cast<size_t>(all * (taps + 1)));
        memory.resize(HG_UIO_REALS(s.A.rows(), s.B.cols(), config.hull.modes));
    }
    bool start(Eigen::Index all, int taps)
    {
        return hg_ring_start(&ring, static_cast<std::uint8_t>(all), static_cast<std::uint8_t>(taps + 1), ring_memory.data()) == HG_OK &&
               hg_uio_start(&self, &config, &ring, HG_START_REST, memory.data()) == HG_OK;
    }
};

/* The exact radius by the impulse response, what the tail by modes may add, and what a common one would. */
struct Sums {
    Vector exact, modal, common;
};

Sums sums_of(const System &s, const Modes &modes, int taps, const std::vector<Vector> &radii)
{
    Sums         sum{s.D_abs * radii.back(), Vector::Zero(s.C.rows()), Vector::Zero(s.C.rows())};
    Matrix       response = s.B;
    const double slowest = modes.decay.maxCoeff();
    const Vector at_once = modes.output.rowwise().sum(), most = modes.input.colwise().maxCoeff().transpose();
    sum.modal = sum.common = sum.exact;
    for (size_t lag = 1; lag < radii.size(); ++lag) {
        const Vector &radius = radii[radii.size() - 1 - lag];
        const Vector  part = (s.C * response).cwiseAbs() * radius;
        const auto    behind = static_cast<double>(lag) - taps;
        sum.exact += part;
        if (behind < 0) {
            sum.modal += part;
            sum.common += part;
        } else {
            sum.modal += modes.output * Vector(modes.decay.array().pow(behind)).asDiagonal() * modes.input * radius;
            sum.common += at_once * std::pow(slowest, behind) * most.dot(radius);
        }
        response = s.A * response;
    }
    return sum;
}

std::string compare_estimates(const Estimating &lib, const oracle::UnknownInputObserver &exact, const Vector &tolerance, const Reals &estimate,
                              UioCount &count)
{
    const Eigen::Index q = exact.input().size();
    for (Eigen::Index i = 0; i < lib.system.C.rows(); ++i) {
        const double mine = (i < q) ? exact.input()(i) : exact.state()(i - q), its = static_cast<double>(estimate[static_cast<size_t>(i)]);
        count.wrong = std::max(count.wrong, std::abs(its - mine) / tolerance(i));
        if (!(std::abs(its - mine) <= tolerance(i))) { return say("estimate %ld: %.17g, oracle %.17g, tolerance %g", static_cast<long>(i), its, mine, tolerance(i)); }
    }
    return {};
}

std::string compare_radii(const Sums &sum, double slack, double noise, const Reals &bound, UioCount &count)
{
    for (Eigen::Index i = 0; i < sum.exact.size(); ++i) {
        const double its = static_cast<double>(bound[static_cast<size_t>(i)]);
        if (!(its >= sum.exact(i) * (1.0 - 1e-12) - noise)) { return say("radius %ld: %.17g below the exact %.17g", static_cast<long>(i), its, sum.exact(i)); }
        if (!(its <= sum.modal(i) * (1.0 + slack) + noise)) { return say("radius %ld: %.17g above %.17g", static_cast<long>(i), its, sum.modal(i)); }
        if (sum.exact(i) > 1e3 * noise) {
            count.wide += std::log(its / sum.exact(i));
            count.common += std::log(sum.common(i) / sum.exact(i));
            count.radii++;
        }
    }
    return {};
}

/* Constant unknown inputs move the plant from rest; in the end all estimates are the truth, because y is straight by then. */
std::string truth_is_found(const UnknownInput &u, Estimating &lib, const std::vector<std::uint8_t> &places, const Vector &tolerance, Random &random)
{
    const oracle::UnknownInputObserver o(u.plant, u.K1, u.sample_time, u.low);
    const Eigen::Index q = u.low.size(), n = o.Ad.rows();
    const Vector       f = random.matrix(q, 1), in = random.matrix(o.Bd.cols(), 1);
    Vector             x = Vector::Zero(n);
    Reals              value(lib.ring.width), estimate(static_cast<size_t>(n + q)), bound(estimate.size()), none(lib.ring.width);
    hg_uio_reset(&lib.self, HG_START_REST);
    hg_ring_reset(&lib.ring);
    for (int k = 0; k < 6000; ++k) {
        Vector signals(places.size());
        signals << u.plant.C * x, in;
        for (size_t i = 0; i < places.size(); ++i) { value[places[i]] = nearest(signals(static_cast<Eigen::Index>(i))); }
        if (hg_ring_push(&lib.ring, none.data()) != HG_OK || hg_uio_step(&lib.self, value.data(), &lib.ring, estimate.data(), bound.data()) != HG_OK) { return "refused"; }
        x = o.Ad * x + o.Bd * in + o.Gd * f;
    }
    for (Eigen::Index i = 0; i < n + q; ++i) {
        const double truth = (i < q) ? f(i) : x(i - q), its = static_cast<double>(estimate[static_cast<size_t>(i)]);
        if (!(std::abs(its - truth) <= tolerance(i) + 1e-8)) { return say("estimate %ld: %.17g, truth %.17g, tolerance %g", static_cast<long>(i), its, truth, tolerance(i)); }
    }
    return {};
}

std::string one_uio(Random &random, UioCount &count)
{
    const UnknownInput           u = random_unknown_input(random);
    oracle::UnknownInputObserver exact(u.plant, u.K1, u.sample_time, u.low);
    const System                 s = estimator(exact, u.low);
    const Eigen::Index           width = s.B.cols(), m = exact.H.cols(), all = width + random.whole(0, 2), q = u.low.size();
    if (!diagonalisable(s.A)) { return {}; }
    const auto  places = random_places(random, width, all);
    const int   taps = random.whole(1, 40), samples = 150;
    Estimating  lib(s, places, all, q, taps);
    if (!lib.start(all, taps)) { return "start refused"; }
    ++count.observers;

    std::vector<Vector> radii;
    std::vector<int>    mode(static_cast<size_t>(all), 1);
    Reals               radius(static_cast<size_t>(all)), value(static_cast<size_t>(all)), estimate(static_cast<size_t>(s.C.rows())), bound(estimate.size());
    const Vector        ones = Vector::Ones(width);
    Matrix              reach = s.B_abs, response = s.B; /* of the state, for signals of at most 1 */
    for (int j = 0; j < 3000; ++j) {
        response = s.A * response;
        reach += response.cwiseAbs();
    }
    const Vector tolerance = 4.0 * rounding(s, m, reach * ones, ones, unit) + Vector::Constant(s.C.rows(), 1e-11);
    for (int k = 0; k < samples; ++k) {
        random_radii(random, radius, mode);
        Vector in(width), wide(width);
        for (hg_real &v : value) { v = nearest(random.real(-1.0, 1.0)); }
        for (Eigen::Index i = 0; i < width; ++i) {
            in(i) = static_cast<double>(value[places[static_cast<size_t>(i)]]);
            wide(i) = static_cast<double>(radius[places[static_cast<size_t>(i)]]);
        }
        exact.step(in.head(m), in.tail(width - m));
        radii.push_back(wide);
        if (hg_ring_push(&lib.ring, radius.data()) != HG_OK || hg_uio_step(&lib.self, value.data(), &lib.ring, estimate.data(), bound.data()) != HG_OK) { return "refused"; }
        std::string wrong = compare_estimates(lib, exact, tolerance, estimate, count);
        const Sums  sum = sums_of(s, lib.modes, taps, radii);
        if (wrong.empty()) { wrong = compare_radii(sum, 8.0 * unit * (taps * static_cast<double>(width) + 20.0 + 4.0 * (k + 1)), 1e-11 * sum.modal.maxCoeff(), bound, count); }
        if (!wrong.empty()) { return say("k %d: ", k) + wrong; }
    }
    return truth_is_found(u, lib, places, tolerance, random);
}

void test_uio(void **)
{
    Random      random = stream(9);
    UioCount    count;
    std::string failure;
    for (int i = 0; i < problems / 10 && failure.empty(); ++i) {
        failure = one_uio(random, count);
        if (!failure.empty()) { failure = say("observer %d: ", i) + failure; }
    }
    const double wide = std::exp(count.wide / std::max(count.radii, 1)), common = std::exp(count.common / std::max(count.radii, 1));
    std::printf("uio: %d observers, worst difference %.3g of its tolerance, radii %.3g x exact (%.3g with one decay; geometric means)\n", count.observers, count.wrong, wide, common);
    if (failure.empty() && count.observers < problems / 20) { failure = "too few observers"; }
    expect_clean(failure);
}

void test_detector(void **)
{
    Random      random = stream(7);
    std::string failure;
    long        confirmed = 0;
    for (int i = 0; i < problems / 2 && failure.empty(); ++i) {
        Chain chain(random, confirmed);
        failure = chain.run();
        if (!failure.empty()) { failure = say("detector %d: ", i) + failure; }
    }
    std::printf("detector: %ld samples confirmed after the fault\n", confirmed);
    if (failure.empty() && confirmed == 0) { failure = "no fault was ever found"; }
    expect_clean(failure);
}

} // namespace

int main()
{
    const char *seed = std::getenv("HULLGUARD_SEED");
    the_seed = seed != nullptr ? std::strtoull(seed, nullptr, 10) : std::random_device{}();
    std::printf("HULLGUARD_SEED=%llu (%s)\n", static_cast<unsigned long long>(the_seed), sizeof(hg_real) == 8 ? "float64" : "float32");
    const CMUnitTest tests[] = {
        cmocka_unit_test(test_uio), cmocka_unit_test(test_residual), cmocka_unit_test(test_hull),  cmocka_unit_test(test_oracle_itself),
        cmocka_unit_test(test_trigger),  cmocka_unit_test(test_hold), cmocka_unit_test(test_decision),
        cmocka_unit_test(test_detector), cmocka_unit_test(test_bank),
    };
    return cmocka_run_group_tests_name("oracle", tests, nullptr, nullptr);
}
