// The curves of a pbrt scene (versions 3 and 4): https://pbrt.org/fileformat-v4. Everything but curves and the
// transforms that place them is skipped, or refused where skipping it would put curves in the wrong place.
#include <array>
#include <set>

#include "render/error.hpp"
#include "render/strand_file.hpp"

namespace medulla::render {
namespace {

enum class Kind { word, text, number, open, close, end };

struct Token {
    Kind kind = Kind::end;
    std::string_view text;
    double number = 0;
    std::size_t line = 1;
};

class Lexer {
  public:
    Lexer(const std::string& path, const std::string& bytes) : path_(path), rest_(bytes) { next(); }

    const Token& peek() const { return token_; }
    Token take() {
        const Token taken = token_;
        next();
        return taken;
    }
    [[noreturn]] void fail(std::size_t line, const std::string& expected, std::string_view found) const {
        throw Error("{}:{}: expected {}, found {}", path_, line, expected,
                    found.empty() ? "the end" : printable(found));
    }
    double number(const char* what) {
        if (token_.kind != Kind::number) fail(token_.line, what, token_.text);
        return take().number;
    }

  private:
    void next() {
        for (;;) {
            while (!rest_.empty() && (rest_[0] == ' ' || rest_[0] == '\t' || rest_[0] == '\r' || rest_[0] == '\n')) {
                line_ += rest_[0] == '\n';
                rest_.remove_prefix(1);
            }
            if (rest_.empty() || rest_[0] != '#') break;
            rest_.remove_prefix(std::min(rest_.size(), rest_.find('\n')));
        }
        token_ = {};
        token_.line = line_;
        if (rest_.empty()) return;
        const char c = rest_[0];
        std::size_t size = 1;
        if (c == '[' || c == ']') {
            token_.kind = c == '[' ? Kind::open : Kind::close;
        } else if (c == '"') {
            const std::size_t close = rest_.find_first_of("\"\n", 1);
            if (close == std::string_view::npos || rest_[close] != '"') fail(line_, "a closing quote", rest_);
            token_.kind = Kind::text, token_.text = rest_.substr(1, close - 1);
            rest_.remove_prefix(close + 1);
            return;
        } else {
            size = std::min(rest_.size(), rest_.find_first_of(" \t\r\n[]\"#"));
            const std::string_view word = rest_.substr(0, size);
            const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
            token_.kind = letter ? Kind::word : Kind::number;
            if (!letter && !read_number(word, token_.number)) fail(line_, "a number", word);
        }
        token_.text = rest_.substr(0, size);
        rest_.remove_prefix(size);
    }

    const std::string& path_;
    std::string_view rest_;
    std::size_t line_ = 1;
    Token token_;
};

/// An affine map, row by row.
struct Affine {
    std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

    friend Affine operator*(const Affine& a, const Affine& b) {
        Affine c;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 4; ++j) {
                c.m[4 * i + j] = j == 3 ? a.m[4 * i + 3] : 0;
                for (std::size_t k = 0; k < 3; ++k) c.m[4 * i + j] += a.m[4 * i + k] * b.m[4 * k + j];
            }
        return c;
    }
    Vec3 point(const double* p) const {
        const auto row = [&](std::size_t i) {
            return float(m[i] * p[0] + m[i + 1] * p[1] + m[i + 2] * p[2] + m[i + 3]);
        };
        return {row(0), row(4), row(8)};
    }
    double determinant() const {
        return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
               m[2] * (m[4] * m[9] - m[5] * m[8]);
    }
};

Affine rotation(double degrees, double x, double y, double z) {
    const double n = std::sqrt(x * x + y * y + z * z), a = degrees * 3.14159265358979323846 / 180;
    x /= n, y /= n, z /= n;
    const double c = std::cos(a), s = std::sin(a), d = 1 - c;
    return {{x * x * d + c, x * y * d - z * s, x * z * d + y * s, 0, y * x * d + z * s, y * y * d + c,
             y * z * d - x * s, 0, z * x * d - y * s, z * y * d + x * s, z * z * d + c, 0}};
}

// Statements that do not affect where curves are.
const std::set<std::string_view> skipped{
    "Accelerator", "AreaLightSource", "Attribute",         "Camera",      "ColorSpace",       "CoordinateSystem",
    "Film",        "Filter",          "Integrator",        "LightSource", "LookAt",           "MakeNamedMaterial",
    "Material",    "MediumInterface", "NamedMaterial",     "Option",      "PixelFilter",      "MakeNamedMedium",
    "Renderer",    "Sampler",         "SurfaceIntegrator", "Texture",     "VolumeIntegrator", "ReverseOrientation",
    "WorldEnd"};

class CurveReader {
  public:
    CurveReader(const std::string& path, const std::string& bytes, const StrandFile& how)
        : path_(path), lexer_(path, bytes), how_(how) {}

    Strands read() {
        while (lexer_.peek().kind != Kind::end) statement();
        if (!stack_.empty()) lexer_.fail(lexer_.peek().line, "AttributeEnd", "");
        close_strand();
        if (strands_.count() == 0) throw Error("{}: expected at least one Shape \"curve\", found none", path_);
        return std::move(strands_);
    }

  private:
    void statement() {
        const Token word = lexer_.take();
        if (word.kind != Kind::word) lexer_.fail(word.line, "a statement", word.text);
        if (word.text == "Shape") return shape(word.line);
        if (word.text == "AttributeBegin" || word.text == "TransformBegin") {
            stack_.push_back(now_);
        } else if (word.text == "AttributeEnd" || word.text == "TransformEnd") {
            if (stack_.empty()) lexer_.fail(word.line, "as many begins as ends", word.text);
            now_ = stack_.back();
            stack_.pop_back();
        } else if (word.text == "Identity" || word.text == "WorldBegin") {
            now_ = {};
        } else if (word.text == "Translate") {
            const auto v = numbers<3>();
            now_ = now_ * Affine{{1, 0, 0, v[0], 0, 1, 0, v[1], 0, 0, 1, v[2]}};
        } else if (word.text == "Scale") {
            const auto v = numbers<3>();
            now_ = now_ * Affine{{v[0], 0, 0, 0, 0, v[1], 0, 0, 0, 0, v[2], 0}};
        } else if (word.text == "Rotate") {
            const auto v = numbers<4>();
            if (v[1] == 0 && v[2] == 0 && v[3] == 0) lexer_.fail(word.line, "an axis of Rotate", "0 0 0");
            now_ = now_ * rotation(v[0], v[1], v[2], v[3]);
        } else if (word.text == "Transform" || word.text == "ConcatTransform") {
            const bool bracket = lexer_.peek().kind == Kind::open;
            if (bracket) lexer_.take();
            const auto v = numbers<16>();  // column by column
            if (v[3] != 0 || v[7] != 0 || v[11] != 0 || v[15] != 1)
                lexer_.fail(word.line, "an affine matrix, whose last row is 0 0 0 1",
                            fmt::format("{} {} {} {}", v[3], v[7], v[11], v[15]));
            if (bracket && lexer_.take().kind != Kind::close) lexer_.fail(word.line, "16 numbers and ]", "more");
            const Affine m{{v[0], v[4], v[8], v[12], v[1], v[5], v[9], v[13], v[2], v[6], v[10], v[14]}};
            now_ = word.text == "Transform" ? m : now_ * m;
        } else if (skipped.count(word.text) != 0) {
            skip_values();
        } else {
            lexer_.fail(word.line, "a statement that files of curves may have (docs/render.md)", word.text);
        }
    }

    template <std::size_t N>
    std::array<double, N> numbers() {
        std::array<double, N> v;
        for (double& x : v) x = lexer_.number("a number");
        return v;
    }

    /// Up to the next statement.
    void skip_values() {
        while (lexer_.peek().kind != Kind::end) {
            const Token& next = lexer_.peek();
            if (next.kind == Kind::word && next.text != "true" && next.text != "false") return;
            lexer_.take();
        }
    }

    void shape(std::size_t line) {
        const Token form = lexer_.take();
        if (form.kind != Kind::text) lexer_.fail(form.line, "the name of a shape", form.text);
        if (form.text != "curve") return skip_values();
        std::vector<double> points;
        double width[2] = {1, 1};
        std::string_view basis = "bezier";
        while (lexer_.peek().kind == Kind::text) {
            const Token declaration = lexer_.take();
            const std::size_t space = declaration.text.find(' ');
            const std::string_view name =
                space == std::string_view::npos ? "" : declaration.text.substr(declaration.text.rfind(' ') + 1);
            std::vector<double> values;
            std::string_view text;
            const bool bracket = lexer_.peek().kind == Kind::open;
            if (bracket) lexer_.take();
            do {
                const Token value = lexer_.take();
                const bool word = value.kind == Kind::word && value.text != "true" && value.text != "false";
                if (word || value.kind == Kind::end || value.kind == Kind::open)
                    lexer_.fail(value.line, fmt::format("values of {}", declaration.text), value.text);
                if (value.kind == Kind::close) break;
                if (value.kind == Kind::number) values.push_back(value.number);
                text = value.text;
            } while (bracket);
            const auto one = [&] {
                if (values.size() != 1)
                    lexer_.fail(declaration.line, fmt::format("one number for {}", name),
                                std::to_string(values.size()));
                return values[0];
            };
            if (name == "P") points = std::move(values);
            if (name == "width") width[0] = width[1] = one();
            if (name == "width0") width[0] = one();
            if (name == "width1") width[1] = one();
            if (name == "basis") basis = text;
            if (name == "degree" && one() != 3)
                lexer_.fail(declaration.line, "curves of degree 3", fmt::format("{}", one()));
        }
        curve(line, points, width, basis);
    }

    void curve(std::size_t line, const std::vector<double>& p, const double (&width)[2], std::string_view basis) {
        const std::size_t n = p.size() / 3;
        const bool bezier = basis == "bezier";
        if (!bezier && basis != "bspline") lexer_.fail(line, "basis bezier or bspline", basis);
        if (p.size() % 3 != 0 || n < 4 || (bezier && n % 3 != 1))
            lexer_.fail(line, bezier ? "3 k + 1 points of a Bezier curve" : "four or more points of a B-spline",
                        fmt::format("{} numbers", p.size()));
        float radius[2] = {how_.radius, how_.radius};
        if (how_.radius == 0) {
            // A non-uniform scale would not keep the fibre round: use the geometric mean of the three scales.
            const double scale = 0.5 * std::cbrt(std::abs(now_.determinant())) * double(how_.placement.scale);
            for (int k = 0; k < 2; ++k) radius[k] = float(width[k] * scale);
            if (!(width[0] >= 0 && width[1] >= 0 && radius[0] + radius[1] > 0 && radius[0] + radius[1] < 1e9f))
                lexer_.fail(line, "widths > 0 (`radius` sets one)", fmt::format("{} {}", width[0], width[1]));
        }
        for (float& r : radius) r *= how_.radius_scale;
        points_.clear();
        for (std::size_t k = 0; k < n; ++k) {
            const Vec3 q = how_.placement.point(now_.point(p.data() + 3 * k));
            if (!finite(q) || greatest_size(q) > 1e9f)
                lexer_.fail(line, "points up to 1e9", fmt::format("{:g} {:g} {:g}", q.x, q.y, q.z));
            points_.push_back(q);
        }
        float extent = 0;
        for (const Vec3& q : points_) extent = std::max(extent, length(q - points_[0]));
        if (!(extent > 0)) lexer_.fail(line, "a curve of length > 0", "0");

        // Exporters cut a strand into curves: one that begins where the last ended continues it.
        const bool goes_on = bezier && open_ && length(points_[0] - end_) == 0;
        if (!goes_on) close_strand();
        if (bezier) {
            const float pieces = float((n - 1) / 3);
            for (std::size_t k = 0; k + 3 < n; k += 3)
                add_bezier({points_[k], points_[k + 1], points_[k + 2], points_[k + 3]},
                           mix(radius[0], radius[1], float(k / 3) / pieces),
                           mix(radius[0], radius[1], float(k / 3 + 1) / pieces), strands_);
            open_ = true, end_ = points_.back();
        } else {
            add_bspline(points_, radius[0], radius[1], strands_);
            end_strand(strands_);
        }
    }

    void close_strand() {
        if (open_) end_strand(strands_);
        open_ = false;
    }

    const std::string& path_;
    Lexer lexer_;
    StrandFile how_;
    Affine now_;
    std::vector<Affine> stack_;
    std::vector<Vec3> points_;
    Strands strands_;
    bool open_ = false;  ///< whether the last strand, of Bezier curves, may continue
    Vec3 end_;
};

}  // namespace

Strands read_pbrt_curves(const std::string& path, const std::string& bytes, const StrandFile& how) {
    return CurveReader(path, bytes, how).read();
}

}  // namespace medulla::render
