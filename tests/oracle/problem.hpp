/** @file
 *  What the tests of this folder share: random numbers and systems, and tables of the library made from them. */
#ifndef HULLGUARD_TESTS_PROBLEM_HPP
#define HULLGUARD_TESTS_PROBLEM_HPP

#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <random>
#include <setjmp.h>
#include <string>
#include <vector>

extern "C" {
#include <cmocka.h>

#include "hullguard/hull.h"
#include "hullguard/residual.h"
}

namespace problem {

using oracle::Matrix;
using oracle::Vector;
using std::size_t;
using Reals = std::vector<hg_real>;

constexpr double unit = static_cast<double>(std::numeric_limits<hg_real>::epsilon()); /* two units of rounding of the library's number */
constexpr double unit_double = std::numeric_limits<double>::epsilon();
inline int       problems = 300; /* of each kind; begin_run() */

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

inline std::uint64_t the_seed = 0;

/* One stream a test, so that a test repeats alone. */
inline Random stream(std::uint64_t test) { return Random(the_seed * 1000003U + test); }

inline std::string say(const char *format, ...) __attribute__((format(printf, 1, 2)));
inline std::string say(const char *format, ...)
{
    char    text[600];
    va_list list;
    va_start(list, format);
    std::vsnprintf(text, sizeof text, format, list);
    va_end(list);
    return text;
}

/* Only here may cmocka jump out: nothing with a destructor is alive above the caller's result. */
inline void expect_clean(const std::string &failure)
{
    if (!failure.empty()) {
        fail_msg("HULLGUARD_SEED=%llu: %s", static_cast<unsigned long long>(the_seed), failure.c_str());
    }
}

inline hg_real nearest(double x) { return static_cast<hg_real>(x); }

inline hg_real round_up(double x)
{
    const hg_real y = nearest(x);
    return (static_cast<double>(y) < x) ? std::nextafter(y, std::numeric_limits<hg_real>::infinity()) : y;
}

inline Reals row_major(const Matrix &m)
{
    Reals out;
    for (Eigen::Index i = 0; i < m.rows(); ++i) {
        for (Eigen::Index j = 0; j < m.cols(); ++j) {
            out.push_back(nearest(m(i, j)));
        }
    }
    return out;
}

inline double spectral_radius(const Matrix &m)
{
    return m.rows() == 0 ? 0.0 : m.eigenvalues().cwiseAbs().maxCoeff();
}

inline Matrix beside(const Matrix &a, const Matrix &b)
{
    Matrix out(a.rows(), a.cols() + b.cols());
    out << a, b;
    return out;
}

/* ---- Random generators ---- */

/* Real, complex, repeated and defective eigenvalues within the radius, seen from a random basis. */
inline Matrix random_stable(Random &random, Eigen::Index n, double radius)
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
inline oracle::Generator random_generator(Random &random)
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

inline System plain(const Matrix &A, const Matrix &B, const Matrix &C, const Matrix &D)
{
    return {A, B, C, D, A.cwiseAbs(), B.cwiseAbs(), C.cwiseAbs(), D.cwiseAbs()};
}

/* residual.h; platoon, section 3, "Fused form" */
inline System fused(const oracle::Generator &g)
{
    System s = plain(g.G - g.Lo * g.W, beside(g.L + g.Lo * g.V, g.H - g.Lo * g.Qu), -g.Mo * g.W, g.Mo * beside(g.V, -g.Qu));
    const Matrix Lo = g.Lo.cwiseAbs(), Mo = g.Mo.cwiseAbs();
    s.A_abs = g.G.cwiseAbs() + Lo * g.W.cwiseAbs();
    s.B_abs = beside(g.L.cwiseAbs() + Lo * g.V.cwiseAbs(), g.H.cwiseAbs() + Lo * g.Qu.cwiseAbs());
    s.C_abs = Mo * g.W.cwiseAbs();
    s.D_abs = Mo * beside(g.V, g.Qu).cwiseAbs();
    return s;
}

inline System observer(const oracle::Generator &g) { return plain(g.G, beside(g.L, g.H), -g.W, beside(g.V, -g.Qu)); }
inline System filter(const oracle::Generator &g)
{
    System s = plain(g.G - g.Lo * g.W, g.Lo, -g.Mo * g.W, g.Mo);
    s.A_abs = g.G.cwiseAbs() + g.Lo.cwiseAbs() * g.W.cwiseAbs();
    s.C_abs = g.Mo.cwiseAbs() * g.W.cwiseAbs();
    return s;
}

/* Observer and filter in series as one system of twice the order, for its rounding bound. */
inline System series(const oracle::Generator &g)
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
inline Vector rounding(const System &s, Eigen::Index inner, const Vector &state_max, const Vector &input_max, double epsilon)
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

inline std::vector<std::uint8_t> identity_places(Eigen::Index n)
{
    std::vector<std::uint8_t> places(static_cast<size_t>(n));
    std::iota(places.begin(), places.end(), static_cast<std::uint8_t>(0));
    return places;
}

/* Distinct places of `width` signals in a vector of `of`. */
inline std::vector<std::uint8_t> random_places(Random &random, Eigen::Index width, Eigen::Index of)
{
    std::vector<std::uint8_t> places = identity_places(of);
    for (size_t i = places.size() - 1; i > 0; --i) {
        std::swap(places[i], places[static_cast<size_t>(random.integer(0, static_cast<std::int64_t>(i)))]);
    }
    places.resize(static_cast<size_t>(width));
    return places;
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
inline Tail modal_tail(const System &s, const Taps &taps)
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
inline Tail power_tail(const System &s, const Taps &taps)
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
inline bool diagonalisable(const Matrix &A)
{
    const Eigen::EigenSolver<Matrix> eigen(A);
    const Eigen::MatrixXcd           S = eigen.eigenvectors();
    const Vector singular = Eigen::JacobiSVD<Eigen::MatrixXcd>(S).singularValues();
    const double residual = (A * S - S * eigen.eigenvalues().asDiagonal()).cwiseAbs().maxCoeff();
    return singular.minCoeff() > 1e-5 * singular.maxCoeff() && residual <= 1e-12 * (1.0 + A.cwiseAbs().maxCoeff());
}

/* Residuals may forget slower than they must, each at a pace of its own; none at once, or it could take nothing over. Behind no taps at all
 *  stands |h(0)| = |D| too: what is behind one tap bounds the rest, a sample later. */
inline Tail tail_of(Random &random, const System &s, const Taps &taps)
{
    Taps some;
    for (const int t : taps) { some.push_back(std::max(t, 1)); }
    Tail t = diagonalisable(s.A) ? modal_tail(s, some) : power_tail(s, some);
    for (double &decay : t.decay) { decay = std::max(0.05, decay + (random.chance(0.5) ? 0.0 : (1.0 - decay) * random.real(0.0, 0.5))); }
    for (Eigen::Index g = 0; g < t.weight.cols(); ++g) {
        if (taps[static_cast<size_t>(g)] == 0) { t.weight.col(g) = t.weight.col(g).cwiseQuotient(t.decay).cwiseMax(s.D.col(g).cwiseAbs()); }
    }
    return t;
}

/* What the initial state and the disturbances add to a threshold: sample by sample, and what a tail takes over then. */
struct Bias {
    Matrix rest, moving; /* samples x residuals */
    Vector rest_left, moving_left, later; /* left: what theta is given at the end of the tables */
};

/* Tables of a hull. Every table is widened by what the sums of the library can lose (platoon, section 8), then rounded up. */
struct HullTables {
    Reals                     weight, rest, moving, rest_left, moving_left, bias, decay;
    std::vector<std::uint8_t> signal, taps;
    hg_hull_config            config{};

    HullTables(const System &s, const std::vector<std::uint8_t> &places, const Taps &lags, const Bias &start, const Tail &behind, int ready_rest,
               int ready_moving)
        : signal(places), taps(lags.begin(), lags.end())
    {
        const double widen = 1.0 + unit * (10.0 + 2.0 * static_cast<double>(s.B.cols()) + std::accumulate(lags.begin(), lags.end(), 0.0));
        lay_out(s, behind, widen);
        append(rest, start.rest * widen);
        append(moving, start.moving * widen);
        append(rest_left, start.rest_left * widen);
        append(moving_left, start.moving_left * widen);
        append(bias, start.later * widen);
        append(decay, behind.decay * (1.0 + 8.0 * unit));
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
    }
    HullTables(const HullTables &) = delete;
    HullTables &operator=(const HullTables &) = delete;

    /* hull.h: of each two residuals signal after signal, lag after lag, and the tail behind the lags. */
    void lay_out(const System &s, const Tail &behind, double widen)
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
                append(weight, behind.weight.block(i, g, both, 1) * widen);
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

/* Radii of one sample: bursts, long silences (a radius that grows), nothing. */
inline void random_radii(Random &random, Reals &radius, std::vector<int> &mode)
{
    for (size_t i = 0; i < radius.size(); ++i) {
        if (random.chance(0.05)) { mode[i] = random.whole(0, 3); }
        const double old = static_cast<double>(radius[i]);
        radius[i] = nearest(mode[i] == 0 ? 0.0 : mode[i] == 1 ? random.real(0.0, 1.0) : mode[i] == 2 ? std::min(50.0, old * 1.1 + 0.01) : old);
    }
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

inline void draw_observer(Random &random, Loop &l)
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

inline Loop random_loop(Random &random)
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
inline Matrix bias_by_error(const Loop &l, int rows)
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

/* Seed and length of a run, from the environment. */
inline void begin_run()
{
    const char *seed = std::getenv("HULLGUARD_SEED");
    the_seed = seed != nullptr ? std::strtoull(seed, nullptr, 10) : std::random_device{}();
    const char *many = std::getenv("HULLGUARD_PROBLEMS");
    problems = many != nullptr ? std::atoi(many) : problems;
    std::printf("HULLGUARD_SEED=%llu (%s)\n", static_cast<unsigned long long>(the_seed), sizeof(hg_real) == 8 ? "float64" : "float32");
}

} // namespace problem

#endif
