using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;

namespace Gsac
{
    /// <summary>
    /// JSON text to Dictionary&lt;string, object&gt;, List&lt;object&gt;, string, long, double, bool and null.
    /// Throws FormatException on anything else; depth is bounded, so that hostile text cannot exhaust the stack.
    /// </summary>
    public sealed class GsacJson
    {
        const int MaxDepth = 100;
        readonly string text;
        int at;

        GsacJson(string text)
        {
            this.text = text;
        }

        public static object Parse(string text)
        {
            var json = new GsacJson(text);
            object value = json.Value(0);
            json.Blank();
            if (json.at != text.Length) throw json.Bad("text after its end");
            return value;
        }

        FormatException Bad(string what)
        {
            return new FormatException("JSON: " + what + " at " + at);
        }

        void Blank()
        {
            while (at < text.Length && (text[at] == ' ' || text[at] == '\n' || text[at] == '\r' || text[at] == '\t')) at++;
        }

        char Next()
        {
            Blank();
            if (at >= text.Length) throw Bad("unexpected end");
            return text[at];
        }

        object Value(int depth)
        {
            if (depth > MaxDepth) throw Bad("too deep");
            char c = Next();
            if (c == '{') return Table(depth);
            if (c == '[') return Row(depth);
            if (c == '"') return Text();
            if (c == '-' || (c >= '0' && c <= '9')) return Number();
            if (Word("true")) return true;
            if (Word("false")) return false;
            if (Word("null")) return null;
            throw Bad("unexpected character");
        }

        bool Word(string word)
        {
            if (string.CompareOrdinal(text, at, word, 0, word.Length) != 0) return false;
            at += word.Length;
            return true;
        }

        Dictionary<string, object> Table(int depth)
        {
            var table = new Dictionary<string, object>();
            at++;
            if (Next() == '}')
            {
                at++;
                return table;
            }
            while (true)
            {
                if (Next() != '"') throw Bad("expected a name");
                string name = Text();
                if (Next() != ':') throw Bad("expected a colon");
                at++;
                table[name] = Value(depth + 1);
                char c = Next();
                at++;
                if (c == '}') return table;
                if (c != ',') throw Bad("expected a comma");
            }
        }

        List<object> Row(int depth)
        {
            var row = new List<object>();
            at++;
            if (Next() == ']')
            {
                at++;
                return row;
            }
            while (true)
            {
                row.Add(Value(depth + 1));
                char c = Next();
                at++;
                if (c == ']') return row;
                if (c != ',') throw Bad("expected a comma");
            }
        }

        string Text()
        {
            at++;
            int start = at;
            while (at < text.Length && text[at] != '"' && text[at] != '\\' && text[at] >= ' ') at++;
            if (at < text.Length && text[at] == '"') return text.Substring(start, at++ - start);
            var built = new StringBuilder(text, start, at - start, at - start + 16);
            while (true)
            {
                if (at >= text.Length) throw Bad("text without end");
                char c = text[at++];
                if (c == '"') return built.ToString();
                if (c < ' ') throw Bad("control character in text");
                built.Append(c == '\\' ? Escape() : c);
            }
        }

        char Escape()
        {
            if (at >= text.Length) throw Bad("text without end");
            char c = text[at++];
            switch (c)
            {
                case '"': case '\\': case '/': return c;
                case 'b': return '\b';
                case 'f': return '\f';
                case 'n': return '\n';
                case 'r': return '\r';
                case 't': return '\t';
                case 'u':
                    int code = 0;
                    for (int i = 0; i < 4; i++)
                    {
                        int digit = at < text.Length ? "0123456789abcdef".IndexOf(char.ToLowerInvariant(text[at])) : -1;
                        if (digit < 0) throw Bad("bad escape");
                        code = code * 16 + digit;
                        at++;
                    }
                    return (char)code;
                default: throw Bad("bad escape");
            }
        }

        object Number()
        {
            int start = at;
            if (text[at] == '-') at++;
            int whole = at;
            Digits();
            if (at - whole > 1 && text[whole] == '0') throw Bad("number with leading zero");
            bool real = false;
            if (at < text.Length && text[at] == '.')
            {
                real = true;
                at++;
                Digits();
            }
            if (at < text.Length && (text[at] == 'e' || text[at] == 'E'))
            {
                real = true;
                at++;
                if (at < text.Length && (text[at] == '+' || text[at] == '-')) at++;
                Digits();
            }
            string word = text.Substring(start, at - start);
            long integer;
            if (!real && long.TryParse(word, NumberStyles.AllowLeadingSign, CultureInfo.InvariantCulture, out integer)) return integer;
            double number;
            if (double.TryParse(word, NumberStyles.Float, CultureInfo.InvariantCulture, out number)) return number;
            // its form is right: it is beyond a double, which newer runtimes give as infinity without a word
            return word[0] == '-' ? double.NegativeInfinity : double.PositiveInfinity;
        }

        void Digits()
        {
            int start = at;
            while (at < text.Length && text[at] >= '0' && text[at] <= '9') at++;
            if (at == start) throw Bad("expected a digit");
        }
    }
}
