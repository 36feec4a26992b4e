// Stands for Unity's objects, transforms and avatars. Transforms compute; the rest remembers. API.md: pages and versions.
using System;
using System.Collections.Generic;

namespace UnityEngine
{
    [Flags] public enum HideFlags { DontSave = 52, HideAndDontSave = 61 }

    public class Object
    {
        public string name { get; set; }
        public HideFlags hideFlags { get; set; }
        internal bool Destroyed;
        /// <summary>Materials and Avatars, which stay until somebody destroys them.</summary>
        internal static readonly List<Object> Made = new List<Object>();
        public static void Destroy(Object o)
        {
            if (!Application.isPlaying) throw new InvalidOperationException("Destroy may not be called from edit mode");
            End(o);
        }
        public static void DestroyImmediate(Object o)
        {
            var holder = o as GameObject;
            if (holder != null) holder.transform.SetParent(null, false);
            End(o);
        }
        static void End(Object o)
        {
            var holder = o as GameObject;
            if (!ReferenceEquals(holder, null))
            {
                foreach (Component c in new List<Component>(holder.Components))
                {
                    Player.Call(c, "OnDisable");
                    Player.Call(c, "OnDestroy");
                    c.Destroyed = true;
                }
                foreach (Transform child in new List<Transform>(holder.transform.Children)) End(child.gameObject);
            }
            o.Destroyed = true;
        }
        public static T Instantiate<T>(T original) where T : Component { return Cloner.Clone(original); }
        public static bool operator ==(Object a, Object b)
        {
            bool noA = ReferenceEquals(a, null) || a.Destroyed, noB = ReferenceEquals(b, null) || b.Destroyed;
            return noA || noB ? noA && noB : ReferenceEquals(a, b);
        }
        public static bool operator !=(Object a, Object b) { return !(a == b); }
        public override bool Equals(object other) { return ReferenceEquals(this, other); }
        public override int GetHashCode() { return System.Runtime.CompilerServices.RuntimeHelpers.GetHashCode(this); }
    }

    public class Component : Object
    {
        public GameObject gameObject { get; internal set; }
        public Transform transform { get { return gameObject.transform; } }
        public T GetComponent<T>() { return gameObject.GetComponent<T>(); }
        public T[] GetComponentsInChildren<T>(bool includeInactive)
        {
            var found = new List<T>();
            Collect(gameObject, found);
            return found.ToArray();
        }
        static void Collect<T>(GameObject from, List<T> found)
        {
            foreach (Component c in from.Components) if (c is T) found.Add((T)(object)c);
            foreach (Transform child in from.transform.Children) Collect(child.gameObject, found);
        }
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; } = true;
        public bool isActiveAndEnabled { get { return enabled; } }
    }

    public class MonoBehaviour : Behaviour
    {
    }

    public sealed class GameObject : Object
    {
        internal static new readonly List<Component> Made = new List<Component>();
        internal readonly List<Component> Components = new List<Component>();
        public Transform transform { get; private set; }
        public int layer { get; set; }
        public GameObject(string name)
        {
            this.name = name;
            transform = AddComponent<Transform>();
        }
        public T AddComponent<T>() where T : Component
        {
            return (T)Add(typeof(T));
        }
        Component Add(Type type)
        {
            foreach (RequireComponent need in type.GetCustomAttributes(typeof(RequireComponent), true))
            {
                if (!Components.Exists(c => need.Type.IsInstanceOfType(c))) Add(need.Type);
            }
            var made = (Component)Activator.CreateInstance(type);
            made.gameObject = this;
            made.name = name;
            Components.Add(made);
            if (made is MonoBehaviour) Made.Add(made);
            Player.Call(made, "OnEnable");
            return made;
        }
        public T GetComponent<T>()
        {
            foreach (Component c in Components) if (c is T) return (T)(object)c;
            return default(T);
        }
        public T[] GetComponentsInChildren<T>(bool includeInactive) { return transform.GetComponentsInChildren<T>(includeInactive); }
    }

    public sealed class Transform : Component
    {
        internal readonly List<Transform> Children = new List<Transform>();
        Vector3 place, scale = new Vector3(1, 1, 1);
        Quaternion turn = Quaternion.identity;
        public Transform parent { get; private set; }
        public int childCount { get { return Children.Count; } }
        public bool IsChildOf(Transform parent)
        {
            for (Transform t = this; t != null; t = t.parent) if (t == parent) return true;
            return false;
        }
        public Transform GetChild(int index) { return Children[index]; }
        public Vector3 localPosition { get { return place; } set { place = value; } }
        public Quaternion localRotation { get { return turn; } set { turn = value; } }
        public Vector3 lossyScale { get { return parent == null ? scale : Times(parent.lossyScale, scale); } }
        static Vector3 Times(Vector3 a, Vector3 b) { return new Vector3(a.x * b.x, a.y * b.y, a.z * b.z); }
        public Vector3 localScale { get { return scale; } set { scale = value; } }
        public Vector3 position
        {
            get
            {
                Matrix4x4 m = localToWorldMatrix;
                return new Vector3(m.m03, m.m13, m.m23);
            }
        }
        public Quaternion rotation
        {
            get { return parent == null ? turn : parent.rotation * turn; }
            set { turn = (parent == null ? value : Quaternion.Inverse(parent.rotation) * value).Whole(); }
        }
        public Vector3 forward
        {
            get
            {
                Matrix4x4 m = localToWorldMatrix;
                float n = Mathf.Sqrt(m.m02 * m.m02 + m.m12 * m.m12 + m.m22 * m.m22);
                return new Vector3(m.m02 / n, m.m12 / n, m.m22 / n);
            }
        }
        public Matrix4x4 localToWorldMatrix
        {
            get
            {
                Matrix4x4 own = Matrix4x4.TRS(place, turn, scale);
                return parent == null ? own : parent.localToWorldMatrix * own;
            }
        }
        public Matrix4x4 worldToLocalMatrix { get { return localToWorldMatrix.Inverted(); } }
        public void SetParent(Transform to, bool worldPositionStays)
        {
            Matrix4x4 there = localToWorldMatrix;
            if (parent != null) parent.Children.Remove(this);
            parent = to;
            if (to != null) to.Children.Add(this);
            if (!worldPositionStays) return;
            // of transforms without scale
            if (to != null) there = to.worldToLocalMatrix * there;
            place = new Vector3(there.m03, there.m13, there.m23);
            turn = there.Turn();
        }
        public void SetPositionAndRotation(Vector3 position, Quaternion rotation)
        {
            Matrix4x4 above = parent == null ? Matrix4x4.identity : parent.localToWorldMatrix;
            if (above.m00 != 1 || above.m11 != 1 || above.m22 != 1) throw new NotImplementedException();
            place = position - new Vector3(above.m03, above.m13, above.m23);
            turn = rotation;
        }
    }

    public class ScriptableObject : Object
    {
        public static T CreateInstance<T>() where T : ScriptableObject { return Activator.CreateInstance<T>(); }
    }

    public class TextAsset : Object
    {
        internal byte[] Bytes;
        public byte[] bytes
        {
            get
            {
                Player.FilesRead++;
                return Bytes;
            }
        }
    }

    public sealed class Avatar : Object
    {
        internal HumanDescription Description;
        public bool isValid { get { return true; } }
        public bool isHuman { get { return true; } }
    }

    public sealed class Animator : Behaviour
    {
        public Avatar avatar { get; set; }
    }

    public struct HumanLimit
    {
        public bool useDefaultValues { get; set; }
    }

    public struct HumanBone
    {
        public HumanLimit limit;
        public string boneName { get; set; }
        public string humanName { get; set; }
    }

    public struct SkeletonBone
    {
        public string name;
        public Vector3 position;
        public Quaternion rotation;
        public Vector3 scale;
    }

    public struct HumanDescription
    {
        public HumanBone[] human;
        public SkeletonBone[] skeleton;
        public float upperArmTwist { get; set; }
        public float lowerArmTwist { get; set; }
        public float upperLegTwist { get; set; }
        public float lowerLegTwist { get; set; }
        public float armStretch { get; set; }
        public float legStretch { get; set; }
        public float feetSpacing { get; set; }
        public bool hasTranslationDoF { get; set; }
    }

    public static class AvatarBuilder
    {
        public static Avatar BuildHumanAvatar(GameObject go, HumanDescription humanDescription)
        {
            var made = new Avatar { Description = humanDescription };
            Object.Made.Add(made);
            return made;
        }
    }

    public static class Application
    {
        public static bool isPlaying { get; internal set; } = true;
        public static bool isEditor { get { return false; } }
        public static event Action onBeforeRender;
        internal static void BeforeRender() { if (onBeforeRender != null) onBeforeRender(); }
        public static bool runInBackground { get; set; }
        public static int targetFrameRate { get; set; }
        public static string unityVersion { get { return "stub"; } }
        public static string persistentDataPath { get; internal set; } = ".";
    }

    public static class Time
    {
        public static int frameCount { get; internal set; }
        public static float deltaTime { get; internal set; } = 1 / 60f;
        public static float unscaledDeltaTime { get { return deltaTime; } }
    }

    public static class Debug
    {
        internal static readonly List<string> Errors = new List<string>();
        public static void Log(object message) { }
        public static void LogWarning(object message, Object context) { Errors.Add(message.ToString()); }
        public static void LogError(object message, Object context) { Errors.Add(message.ToString()); }
    }

    public static class Resources
    {
        public static T Load<T>(string path) where T : Object
        {
            var made = (T)Activator.CreateInstance(typeof(T), true);
            made.name = path;
            return made;
        }
    }

    public enum RuntimeInitializeLoadType { SubsystemRegistration = 4 }
    [AttributeUsage(AttributeTargets.Method)] public sealed class RuntimeInitializeOnLoadMethodAttribute : Attribute { public RuntimeInitializeOnLoadMethodAttribute(RuntimeInitializeLoadType loadType) { } }
    [AttributeUsage(AttributeTargets.Class)] public sealed class AddComponentMenu : Attribute { public AddComponentMenu(string menuName) { } }
    [AttributeUsage(AttributeTargets.Class)] public sealed class DisallowMultipleComponent : Attribute { }
    [AttributeUsage(AttributeTargets.Class)] public sealed class ExecuteAlways : Attribute { }
    [AttributeUsage(AttributeTargets.Class)] public sealed class DefaultExecutionOrder : Attribute
    {
        public int order { get; private set; }
        public DefaultExecutionOrder(int order) { this.order = order; }
    }
    [AttributeUsage(AttributeTargets.Class)] public sealed class RequireComponent : Attribute
    {
        internal readonly Type Type;
        public RequireComponent(Type requiredComponent) { Type = requiredComponent; }
    }
    [AttributeUsage(AttributeTargets.Field)] public sealed class SerializeField : Attribute { }
    [AttributeUsage(AttributeTargets.Field)] public sealed class HideInInspector : Attribute { }
    [AttributeUsage(AttributeTargets.Field)] public sealed class TooltipAttribute : Attribute { public TooltipAttribute(string tooltip) { } }
}
