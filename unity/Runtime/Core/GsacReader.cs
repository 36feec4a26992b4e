using System;
using System.Collections.Generic;

namespace Gsac
{
    /// <summary>Turns a container's head and blocks into an avatar and believes nothing. Throws GsacException.</summary>
    public sealed class GsacReader
    {
        readonly GsacContainer file;

        public GsacReader(GsacContainer file)
        {
            this.file = file;
        }

        public GsacData Read()
        {
            var data = new GsacData();
            if (Entry(file.Head, "format") as string != "gsac") throw Bad(GsacFault.Head, "`format` is not gsac");
            Dictionary<string, object> skeleton = Table(file.Head, "joints");
            data.JointNames = Names(skeleton, "names");
            data.Parents = Parents(List(skeleton, "parents"), data.JointNames.Length);
            data.Vertices = file.Reals("rest.vertices", -1, 3);
            int V = data.VertexCount, J = data.JointCount;
            data.Faces = file.Indices("rest.faces", V, -1, 3);
            data.Joints = file.Reals("rest.joints", J, 3);
            data.SkinIndex = file.Indices("skin.index", J, V, 4);
            data.SkinWeight = file.Reals("skin.weight", V, 4);
            CheckWeights(data.SkinWeight);
            ReadExpressions(data);
            if (file.Has("corrective.start")) ReadCorrectives(data);
            ReadLevels(data);
            if (file.Has("light")) data.Light = file.Reals("light", 4, 3);
            ReadPoses(data);
            ReadClips(data);
            data.Licence = Words("licence");
            data.Provenance = Words("provenance");
            ReadBlend(data);
            return data;
        }

        static int[] Parents(List<object> parents, int joints)
        {
            if (joints < 1 || joints > GsacData.MaxJoints || parents.Count != joints)
            {
                throw Bad(GsacFault.Value, "`parents` must name an earlier joint each, -1 for the first");
            }
            var values = new int[joints];
            for (int j = 0; j < joints; j++)
            {
                bool good = parents[j] is long && (j == 0 ? (long)parents[j] == -1 : (long)parents[j] >= 0 && (long)parents[j] < j);
                if (!good) throw Bad(GsacFault.Value, "`parents` must name an earlier joint each, -1 for the first");
                values[j] = (int)(long)parents[j];
            }
            return values;
        }

        static void CheckWeights(float[] weights)
        {
            for (int i = 0; i < weights.Length; i += 4)
            {
                float sum = weights[i] + weights[i + 1] + weights[i + 2] + weights[i + 3];
                float least = Math.Min(Math.Min(weights[i], weights[i + 1]), Math.Min(weights[i + 2], weights[i + 3]));
                if (Math.Abs(sum - 1) > 1e-3 || least < 0) throw Bad(GsacFault.Value, "skin.weight must have rows that sum to 1");
            }
            if (weights.Length == 0) throw Bad(GsacFault.Value, "the mesh has no vertices");
        }

        void ReadExpressions(GsacData data)
        {
            data.Expressions = Names(file.Head, "expressions");
            int E = data.Expressions.Length;
            data.ExpressionStart = file.Indices("expression.start", 1L << 31, E + 1);
            data.ExpressionVertex = file.Indices("expression.vertex", data.VertexCount, -1);
            int M = data.ExpressionVertex.Length;
            data.ExpressionDelta = file.Reals("expression.delta", M, 3);
            data.ExpressionJaw = file.Reals("expression.jaw", E, 3);
            CheckRise(data.ExpressionStart, M, "expression.start");
        }

        void ReadCorrectives(GsacData data)
        {
            var read = new GsacCorrectives { Joint = file.Indices("corrective.joint", data.JointCount, -1) };
            read.Start = file.Indices("corrective.start", 1L << 31, data.VertexCount + 1);
            CheckRise(read.Start, read.Joint.Length, "corrective.start");
            read.Delta = file.Reals("corrective.delta", read.Joint.Length, 3, 9);
            data.Correctives = read;
        }

        static void CheckRise(int[] start, int end, string what)
        {
            bool rises = start[0] == 0 && start[start.Length - 1] == end;
            for (int i = 1; i < start.Length; i++) rises &= start[i - 1] <= start[i];
            if (!rises) throw Bad(GsacFault.Value, what + " must rise from 0 to " + end + ", the number of its rows");
        }

        void ReadLevels(GsacData data)
        {
            List<object> levels = List(file.Head, "levels");
            if (levels.Count == 0 || levels.Count > 16) throw Bad(GsacFault.Head, "`levels` is empty or too long");
            data.Levels = new GsacLevel[levels.Count];
            var prefixes = new HashSet<string>();
            for (int i = 0; i < levels.Count; i++)
            {
                string prefix = Text(levels[i], "prefix");
                if (!prefixes.Add(prefix)) throw Bad(GsacFault.Head, "two levels have the same gaussians");
                var level = new GsacLevel { Face = file.Indices(prefix + ".face", data.Faces.Length / 3, -1) };
                int N = level.Count;
                if (!Entry(levels[i], "count").Equals((long)N)) throw Bad(GsacFault.Value, "a level says it has other than " + N + " gaussians");
                level.Mu = file.Reals(prefix + ".mu", N, 3);
                level.Quat = file.Reals(prefix + ".quat", N, 4);
                level.LogScale = file.Reals(prefix + ".log_scale", N, 3);
                level.Rgb = file.Reals(prefix + ".rgb", N, 3);
                level.Opacity = file.Reals(prefix + ".opacity", N);
                level.MaxHeight = MaxHeight((Dictionary<string, object>)levels[i]);
                for (int q = 0; q < level.Quat.Length; q += 4)
                {
                    double length2 = 0;
                    for (int c = q; c < q + 4; c++) length2 += (double)level.Quat[c] * level.Quat[c];
                    if (Math.Abs(length2 - 1) > 1e-2) throw Bad(GsacFault.Value, prefix + ".quat must hold unit quaternions");
                }
                data.Levels[i] = level;
            }
        }

        static float MaxHeight(Dictionary<string, object> level)
        {
            object said;
            return level.TryGetValue("max_height_px", out said) && said != null ? Optional(level, "max_height_px", 0, 1, 1e6) : 0;
        }

        void ReadPoses(GsacData data)
        {
            foreach (KeyValuePair<string, object> pose in Table(file.Head, "poses"))
            {
                var joints = pose.Value as Dictionary<string, object>;
                if (joints == null) throw Bad(GsacFault.Head, "a pose is not a table of joint -> axis-angle");
                // memory goes with the rows that are there, not with poses times joints
                var still = new GsacClip
                {
                    Name = pose.Key, Fps = 1, Keys = 1, Joints = new int[joints.Count],
                    Rotation = new float[joints.Count * 3], Transl = new float[3],
                };
                int n = 0;
                foreach (KeyValuePair<string, object> row in joints)
                {
                    int j = still.Joints[n] = data.Joint(row.Key);
                    var turn = row.Value as List<object>;
                    if (j < 0 || turn == null || turn.Count != 3) throw Bad(GsacFault.Head, "a pose is not a table of joint -> axis-angle");
                    for (int i = 0; i < 3; i++)
                    {
                        double value = Number(turn[i]);
                        if (!(Math.Abs(value) < 100)) throw Bad(GsacFault.Head, "a pose is not a table of joint -> axis-angle");
                        still.Rotation[n * 3 + i] = (float)value;
                    }
                    n++;
                }
                data.Poses[pose.Key] = still;
            }
        }

        void ReadClips(GsacData data)
        {
            foreach (object entry in List(file.Head, "clips"))
            {
                var clip = new GsacClip { Name = Text(entry, "name") };
                string[] names = Names(entry as Dictionary<string, object>, "joints");
                clip.Joints = new int[names.Length];
                bool known = true;
                for (int i = 0; i < names.Length; i++) known &= (clip.Joints[i] = data.Joint(names[i])) >= 0;
                clip.Fps = (float)Number(Entry(entry, "fps"));
                object loop = Entry(entry, "loop");
                if (!(loop is bool)) throw Bad(GsacFault.Head, "`loop` is missing or of the wrong kind");
                clip.Loop = (bool)loop;
                if (!known || !(clip.Fps >= 0.1f && clip.Fps <= 1000f) || data.Clips.ContainsKey(clip.Name))
                {
                    throw Bad(GsacFault.Value, "a clip names unknown joints, has an odd rate or comes twice");
                }
                clip.Transl = file.Reals("clip." + clip.Name + ".transl", -1, 3);
                clip.Keys = clip.Transl.Length / 3;
                clip.Rotation = file.Reals("clip." + clip.Name + ".rotation", clip.Keys, names.Length, 3);
                if (clip.Keys == 0) throw Bad(GsacFault.Value, "a clip has no keys");
                data.Clips[clip.Name] = clip;
            }
        }

        void ReadBlend(GsacData data)
        {
            data.Ground = Optional(file.Head, "ground", 0, -1e6, 1e6);
            if (!file.Head.ContainsKey("blend")) return;
            Dictionary<string, object> blend = Table(file.Head, "blend");
            data.LowPass = Optional(blend, "low_pass_px2", data.LowPass, 0, 100);
            object energy;
            if (blend.TryGetValue("low_pass_energy", out energy))
            {
                if (!(energy is bool)) throw Bad(GsacFault.Head, "`low_pass_energy` is of the wrong kind");
                data.KeepsEnergy = (bool)energy;
            }
            data.AlphaMax = Optional(blend, "alpha_max", data.AlphaMax, 0, 1);
            data.AlphaMin = Optional(blend, "alpha_min", data.AlphaMin, 1e-6, 1);
        }

        static float Optional(Dictionary<string, object> table, string key, float otherwise, double least, double most)
        {
            object value;
            if (!table.TryGetValue(key, out value)) return otherwise;
            double number = Number(value);
            if (!(number >= least && number <= most)) throw Bad(GsacFault.Value, "`" + key + "` is out of range");
            return (float)number;
        }

        static object Entry(object table, string key)
        {
            object value;
            var found = table as Dictionary<string, object>;
            if (found == null || !found.TryGetValue(key, out value) || value == null)
            {
                throw Bad(GsacFault.Head, "`" + key + "` is missing or of the wrong kind");
            }
            return value;
        }

        static Dictionary<string, object> Table(object table, string key)
        {
            return Entry(table, key) as Dictionary<string, object> ?? throw Bad(GsacFault.Head, "`" + key + "` is of the wrong kind");
        }

        static List<object> List(object table, string key)
        {
            return Entry(table, key) as List<object> ?? throw Bad(GsacFault.Head, "`" + key + "` is of the wrong kind");
        }

        static string Text(object table, string key)
        {
            return Entry(table, key) as string ?? throw Bad(GsacFault.Head, "`" + key + "` is of the wrong kind");
        }

        static double Number(object value)
        {
            if (value is long) return (long)value;
            if (value is double) return (double)value;
            throw Bad(GsacFault.Head, "a number is missing");
        }

        static string[] Names(object table, string key)
        {
            List<object> list = List(table, key);
            var names = new string[list.Count];
            var seen = new HashSet<string>();
            for (int i = 0; i < names.Length; i++)
            {
                names[i] = list[i] as string;
                if (names[i] == null || !seen.Add(names[i])) throw Bad(GsacFault.Head, "`" + key + "` is not a list of different names");
            }
            return names;
        }

        Dictionary<string, string> Words(string key)
        {
            var words = new Dictionary<string, string>();
            foreach (KeyValuePair<string, object> pair in Table(file.Head, key))
            {
                words[pair.Key] = pair.Value as string ?? throw Bad(GsacFault.Head, "`" + key + "` holds more than text");
            }
            return words;
        }

        static GsacException Bad(GsacFault fault, string detail)
        {
            return new GsacException(fault, detail);
        }
    }
}
