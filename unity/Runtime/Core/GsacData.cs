using System.Collections.Generic;

namespace Gsac
{
    /// <summary>The gaussians of one level of detail. Flat arrays, row by row.</summary>
    public sealed class GsacLevel
    {
        public int[] Face;       // N
        public float[] Mu;       // N x 3, in the face frame
        public float[] Quat;     // N x 4, w x y z
        public float[] LogScale; // N x 3
        public float[] Rgb;      // N x 3, display colour
        public float[] Opacity;  // N, 0..1
        public float MaxHeight;  // px: of the person up to which the level is drawn; 0: not said

        public int Count { get { return Face.Length; } }
    }

    /// <summary>A motion: axis-angle keys of some joints at a fixed rate.</summary>
    public sealed class GsacClip
    {
        public string Name;
        public float Fps;
        public bool Loop;
        public int Keys;
        public int[] Joints;
        public float[] Rotation; // Keys x Joints x 3, rad
        public float[] Transl;   // Keys x 3, m
    }

    /// <summary>
    /// An avatar as arrays: rest mesh, skeleton, skin, expressions, gaussians. Canonical axes (right-handed, y up,
    /// facing +z, left = +x) as read; Unity's (left-handed, left = -x) after Mirror().
    /// </summary>
    public sealed class GsacData
    {
        public const int MaxJoints = 256;

        public string[] JointNames;
        public int[] Parents;
        public float[] Joints;           // J x 3, m
        public float[] Vertices;         // V x 3, m
        public int[] Faces;              // F x 3; the order of the corners is part of the binding
        public int[] SkinIndex;          // V x 4
        public float[] SkinWeight;       // V x 4
        public string[] Expressions;
        public int[] ExpressionStart;    // E + 1
        public int[] ExpressionVertex;   // M
        public float[] ExpressionDelta;  // M x 3, m at weight 1
        public float[] ExpressionJaw;    // E x 3, weights for a rotation of the jaw, per rad
        public GsacCorrectives Correctives; // null: the body has none
        public GsacLevel[] Levels;       // finest first
        public float[] Light;            // 4 x 3: the colours' factor by the face's normal, of 1, x, y, z; null: 1
        public Dictionary<string, GsacClip> Poses = new Dictionary<string, GsacClip>(); // of one key each
        public Dictionary<string, GsacClip> Clips = new Dictionary<string, GsacClip>();
        public Dictionary<string, string> Licence = new Dictionary<string, string>();
        public Dictionary<string, string> Provenance = new Dictionary<string, string>();
        public float Ground;
        public float LowPass = 0.3f;
        public bool KeepsEnergy; // the low-pass spreads a gaussian's opacity over the area that it adds
        public float AlphaMax = 0.999f;
        public float AlphaMin = 1f / 255f;
        public bool IsMirrored;

        public int VertexCount { get { return Vertices.Length / 3; } }
        public int JointCount { get { return Parents.Length; } }

        public int Joint(string name)
        {
            return System.Array.IndexOf(JointNames, name);
        }

        /// <summary>Whether the levels say up to which height of the person they are drawn.</summary>
        public bool HasHeights
        {
            get
            {
                foreach (GsacLevel level in Levels)
                {
                    if (level.MaxHeight > 0) return true;
                }
                return false;
            }
        }

        /// <summary>The coarsest level that a person of this height, px, may be drawn by.</summary>
        public int LevelAt(float height)
        {
            int level = Levels.Length - 1;
            while (level > 0 && !(Levels[level].MaxHeight >= height)) level--;
            return level;
        }

        /// <summary>Reads a file; one that is too large is refused before it is read. Throws GsacException, IOException.</summary>
        public static byte[] Load(string path)
        {
            long size = new System.IO.FileInfo(path).Length;
            if (size > GsacContainer.MaxFile)
            {
                throw new GsacException(GsacFault.Oversized, size + " bytes are there, " + GsacContainer.MaxFile + " are accepted");
            }
            return System.IO.File.ReadAllBytes(path);
        }

        /// <summary>Reads a .gsac file's bytes. Throws GsacException.</summary>
        public static GsacData Read(byte[] bytes)
        {
            return new GsacReader(new GsacContainer(bytes)).Read();
        }

        /// <summary>
        /// To Unity's axes and back: x changes its sign. Faces keep their corners' order, so the third column of a face
        /// frame keeps its sense and the second turns round: mu (x, -y, z), quat (w, -x, y, -z), the light's y.
        /// </summary>
        public GsacData Mirror()
        {
            Flip(Joints, -1, 1, 1);
            Flip(Vertices, -1, 1, 1);
            Flip(ExpressionDelta, -1, 1, 1);
            Flip(ExpressionJaw, 1, -1, -1);
            if (Correctives != null) Correctives.Mirror();
            foreach (GsacLevel level in Levels)
            {
                Flip(level.Mu, 1, -1, 1);
                for (int i = 0; i < level.Quat.Length; i += 4)
                {
                    level.Quat[i + 1] = -level.Quat[i + 1];
                    level.Quat[i + 3] = -level.Quat[i + 3];
                }
            }
            for (int i = 6; Light != null && i < 9; i++) Light[i] = -Light[i];
            foreach (GsacClip pose in Poses.Values) Flip(pose);
            foreach (GsacClip clip in Clips.Values) Flip(clip);
            IsMirrored = !IsMirrored;
            return this;
        }

        static void Flip(GsacClip clip)
        {
            Flip(clip.Rotation, 1, -1, -1);
            Flip(clip.Transl, -1, 1, 1);
        }

        static void Flip(float[] rows, int x, int y, int z)
        {
            for (int i = 0; i < rows.Length; i += 3)
            {
                rows[i] *= x;
                rows[i + 1] *= y;
                rows[i + 2] *= z;
            }
        }
    }
}
