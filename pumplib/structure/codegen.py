"""Thesis 6.6: expressions to straight-line code whose rounding is the same in every language.

Powers become products, divisions are kept, common parts are computed once and every operation is written in a fixed
order. A root of a negative number is taken of zero instead and raises a bit of the flag, so that it does not go unseen.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import sympy as sp

from pumplib.errors import ParameterError

Language = Literal["python", "c"]
_FUNCTIONS = {
    sp.exp: "exp",
    sp.log: "log",
    sp.sin: "sin",
    sp.cos: "cos",
    sp.tan: "tan",
    sp.asin: "asin",
    sp.acos: "acos",
    sp.atan: "atan",
    sp.sinh: "sinh",
    sp.cosh: "cosh",
    sp.tanh: "tanh",
    sp.Abs: "fabs",
}
_FLAG_BITS = 31


@dataclass(frozen=True, kw_only=True, slots=True)
class Statement:
    """One line of code.

    Parameters
    ----------
    kind : {"set", "root", "larger", "smaller"}
        Assignment of `text`; assignment of `text` with negative values replaced by zero and flagged; assignment of the
        larger or smaller of `text` and `other`.
    target : str
        Variable.
    text : str
        Expression; functions are written as in C.
    other : str
        Second operand of larger and smaller.
    bit : int
        Number of the flag's bit.
    """

    kind: Literal["set", "root", "larger", "smaller"]
    target: str
    text: str
    other: str = ""
    bit: int = 0


@dataclass(frozen=True, kw_only=True, slots=True)
class Code:
    """Straight-line code for some expressions.

    Parameters
    ----------
    statements : tuple of Statement
        In order.
    results : tuple of str
        Text of each expression, in variables of the statements.
    radicands : tuple of sympy.Expr
        Meaning of the flag's bits: bit k is set where the k-th is negative.
    """

    statements: tuple[Statement, ...]
    results: tuple[str, ...]
    radicands: tuple[Any, ...]


def _literal(value: Any) -> str:
    return repr(float(value))


class _Writer:
    """Collects statements while it writes expressions."""

    def __init__(self, names: Mapping[Any, str], prefix: str, radicands: list[Any], what: str) -> None:
        self.names = dict(names)
        self.prefix = prefix
        self.radicands = radicands
        self.what = what
        self.statements: list[Statement] = []
        self.meaning: dict[Any, Any] = {}  # variable of a common part -> what it stands for
        self._count = 0

    def fresh(self) -> str:
        self._count += 1
        return f"{self.prefix}{self._count - 1}"

    def variable(self, expression: Any) -> str:
        """Name of a variable with the value of an expression."""
        if expression in self.names:
            return self.names[expression]
        target = self.fresh()
        self.statements.append(Statement(kind="set", target=target, text=self.text(expression)))
        return target

    def atom(self, expression: Any) -> str:
        """Text that can stand in any product."""
        text = self.text(expression)
        simple = text.replace(".", "").replace("_", "").replace("[", "").replace("]", "").isalnum()
        return text if simple else f"({text})"

    def _power(self, base: Any, exponent: Any) -> str:
        """Positive power."""
        if exponent == 1:
            return self.atom(base)
        if exponent.is_Integer and exponent <= 64:
            square, rest, parts = self.variable(base), int(exponent), []
            while rest:
                if rest & 1:
                    parts.append(square)
                rest >>= 1
                if rest:
                    target = self.fresh()
                    self.statements.append(Statement(kind="set", target=target, text=f"{square}*{square}"))
                    square = target
            return "*".join(parts) if len(parts) == 1 else f"({'*'.join(parts)})"
        if exponent.is_Rational and exponent.q == 2:
            meaning = base.subs(self.meaning)
            if meaning not in self.radicands:
                self.radicands.append(meaning)
            bit = self.radicands.index(meaning)
            if bit >= _FLAG_BITS:
                raise ParameterError(f"{self.what}: more than {_FLAG_BITS} roots; split the residuals.")
            text, target = self.text(base), self.fresh()
            self.statements.append(Statement(kind="root", target=target, text=text, bit=bit))
            whole = exponent.p // 2
            return f"sqrt({target})" if not whole else f"({self._power_of(target, whole)}*sqrt({target}))"
        return f"pow({self.text(base)}, {self.text(exponent)})"

    @staticmethod
    def _power_of(name: str, exponent: int) -> str:
        return "*".join([name] * exponent)

    def _product(self, expression: Any) -> str:
        sign, above, below = "", [], []
        for factor in sorted(sp.Mul.make_args(expression), key=sp.default_sort_key):
            base, exponent = factor.as_base_exp()
            if factor.is_Rational:
                if factor < 0:
                    sign = "-" if not sign else ""
                if abs(factor.p) != 1:
                    above.append(_literal(abs(factor.p)))
                if factor.q != 1:
                    below.append(_literal(factor.q))
            elif exponent.is_number and exponent.is_real and exponent < 0:
                below.append(self._power(base, -exponent))
            else:
                above.append(self._power(base, exponent) if factor.is_Pow else self.atom(factor))
        top = "*".join(above) or "1.0"
        if not below:
            return f"{sign}{top}"
        bottom = below[0] if len(below) == 1 else f"({'*'.join(below)})"
        return f"{sign}{top}/{bottom}"

    def text(self, expression: Any) -> str:
        """Text of an expression; statements for its roots, powers and extremes are added before it."""
        if expression in self.names:
            return self.names[expression]
        if expression.is_Number or expression.is_NumberSymbol:
            if not expression.is_finite:
                raise ParameterError(f"{self.what}: contains {expression}; must be finite.")
            if expression.is_Rational and expression.q != 1:
                return f"{_literal(expression.p)}/{_literal(expression.q)}"
            return _literal(expression)
        if expression.is_Add:
            terms = sorted(expression.args, key=lambda t: (t.could_extract_minus_sign(), sp.default_sort_key(t)))
            text = self.text(terms[0])
            for term in terms[1:]:
                part = self.text(term)
                text += f" - {part[1:]}" if part.startswith("-") else f" + {part}"
            return text
        if expression.is_Mul or (expression.is_Pow and expression.exp.is_number and expression.exp.is_real):
            return self._product(expression)
        if expression.is_Pow:
            return f"pow({self.text(expression.base)}, {self.text(expression.exp)})"
        if isinstance(expression, sp.Max | sp.Min):
            kind: Literal["larger", "smaller"] = "larger" if isinstance(expression, sp.Max) else "smaller"
            first, *rest = sorted(expression.args, key=sp.default_sort_key)
            name = self.variable(first)
            for other in rest:
                second, target = self.variable(other), self.fresh()
                self.statements.append(Statement(kind=kind, target=target, text=name, other=second))
                name = target
            return name
        function = _FUNCTIONS.get(expression.func)
        if function is None:
            raise ParameterError(
                f"{self.what}: {expression.func} in {expression} cannot be written as code; use powers, roots, exp, "
                "log, trigonometric or hyperbolic functions, Abs, Max and Min."
            )
        return f"{function}({self.text(expression.args[0])})"


def straight_line(
    expressions: Iterable[Any], names: Mapping[Any, str], *, prefix: str, radicands: Sequence[Any] = (), what: str = ""
) -> Code:
    """Code for some expressions.

    Parameters
    ----------
    expressions : iterable of sympy.Expr
        What to compute.
    names : mapping of sympy.Symbol to str
        Variable of every symbol.
    prefix : str
        First letters of the variables that are added.
    radicands : sequence of sympy.Expr
        Flags already in use.
    what : str
        Name of the residual, shown in errors.

    Returns
    -------
    Code

    Raises
    ------
    ParameterError
        If a symbol has no variable or a function cannot be written in both languages.
    """
    expressions = [sp.sympify(e) for e in expressions]
    for e in expressions:
        unnamed = sorted(s.name for s in e.free_symbols if s not in names)
        if unnamed:
            raise ParameterError(f"{what}: {', '.join(unnamed)} in {e} is neither state, signal nor parameter.")
    parts = iter(range(10_000))
    symbols = (sp.Symbol(f"{prefix}part{k}") for k in parts)
    common, reduced = sp.cse(expressions, symbols=symbols, order="canonical")
    writer = _Writer(names, prefix, list(radicands), what)
    for symbol, expression in common:
        writer.names[symbol] = writer.variable(expression)
        writer.meaning[symbol] = expression.subs(writer.meaning)
    results = tuple(writer.text(e) for e in reduced)
    return Code(statements=tuple(writer.statements), results=results, radicands=tuple(writer.radicands))


_CALL = re.compile(rf"\b({'|'.join((*_FUNCTIONS.values(), 'sqrt', 'pow'))})\(")


def _python(text: str) -> str:
    return _CALL.sub(lambda found: "abs(" if found[1] == "fabs" else f"math.{found[1]}(", text)


def lines(code: Code, language: Language, indent: str) -> list[str]:
    """The statements in a language.

    Parameters
    ----------
    code : Code
        The code.
    language : {"python", "c"}
        Language; a variable `flag` must exist.
    indent : str
        Put before every line.

    Returns
    -------
    list of str
    """
    result = []
    for s in code.statements:
        text, other = (s.text, s.other) if language == "c" else (_python(s.text), _python(s.other))
        if language == "python":
            if s.kind in ("set", "root"):
                result.append(f"{indent}{s.target} = {text}")
            if s.kind == "root":
                result += [f"{indent}if {s.target} < 0.0:", f"{indent}    {s.target} = 0.0"]
                result.append(f"{indent}    flag |= {1 << s.bit}")
            if s.kind in ("larger", "smaller"):
                sign = ">" if s.kind == "larger" else "<"
                result.append(f"{indent}{s.target} = {text} if {text} {sign} {other} else {other}")
            continue
        mutable = "" if s.kind == "root" else "const "
        if s.kind in ("set", "root"):
            result.append(f"{indent}{mutable}double {s.target} = {text};")
        if s.kind == "root":
            result += [f"{indent}if ({s.target} < 0.0) {{", f"{indent}    {s.target} = 0.0;"]
            result += [f"{indent}    *flag |= {1 << s.bit};", f"{indent}}}"]
        if s.kind in ("larger", "smaller"):
            sign = ">" if s.kind == "larger" else "<"
            result.append(f"{indent}const double {s.target} = {text} {sign} {other} ? {text} : {other};")
    return result


def results(code: Code, language: Language) -> list[str]:
    """Texts of the expressions in a language.

    Parameters
    ----------
    code : Code
        The code.
    language : {"python", "c"}
        Language.

    Returns
    -------
    list of str
    """
    return [text if language == "c" else _python(text) for text in code.results]
